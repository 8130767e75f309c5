/* A click on a body of the world becomes a strike on its surface: the click's point is turned into the frame of the body's mesh, and the
 * bank says which triangle is nearest. */
#include <carillon.h>
#include <math.h>
#include <stdio.h>

static int fail(const char* message) {
  fprintf(stderr, "click_c: %s\n", message);
  return 1;
}

/* Where the body is: as in carillon_motion, the centre of mass in the world and the rotation w x y z of the mesh's frame. */
typedef struct pose {
  double position_m[3];
  double rotation[4];
} pose;

/* x turned by the inverse of the rotation q. */
static void turn_back(const double q[4], const double x[3], double out[3]) {
  const double u[3] = {-q[1], -q[2], -q[3]};
  const double t[3] = {2 * (u[1] * x[2] - u[2] * x[1]), 2 * (u[2] * x[0] - u[0] * x[2]), 2 * (u[0] * x[1] - u[1] * x[0])};
  out[0] = x[0] + q[0] * t[0] + u[1] * t[2] - u[2] * t[1];
  out[1] = x[1] + q[0] * t[1] + u[2] * t[0] - u[0] * t[2];
  out[2] = x[2] + q[0] * t[2] + u[0] * t[1] - u[1] * t[0];
}

/* The strike of `impulse_n_s` into the surface where the world's point is nearest to it. */
static carillon_status make_strike(const carillon_bank* bank, const pose* at, const double world_m[3], double impulse_n_s,
                                   carillon_impulse* strike) {
  const double* vertices_m = carillon_bank_vertices_m(bank);
  const int32_t* triangles = carillon_bank_triangles(bank);
  const double *a, *b, *c;
  double from_centre[3], point_m[3], centre_m[3], normal[3], length;
  carillon_status status;
  int k;
  for (k = 0; k < 3; ++k) from_centre[k] = world_m[k] - at->position_m[k];
  turn_back(at->rotation, from_centre, point_m);
  carillon_bank_centre_m(bank, centre_m);
  for (k = 0; k < 3; ++k) point_m[k] += centre_m[k];
  status = carillon_bank_nearest_point(bank, point_m, &strike->triangle, strike->barycentric, NULL, NULL);
  if (status != CARILLON_OK) return status;
  a = vertices_m + 3 * triangles[3 * strike->triangle];
  b = vertices_m + 3 * triangles[3 * strike->triangle + 1];
  c = vertices_m + 3 * triangles[3 * strike->triangle + 2];
  for (k = 0; k < 3; ++k) { /* outward: the corners go counter-clockwise */
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    normal[k] = (b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i]);
  }
  length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
  for (k = 0; k < 3; ++k) strike->impulse_n_s[k] = length > 0 ? -impulse_n_s * normal[k] / length : 0;
  return CARILLON_OK;
}

int main(int argc, char** argv) {
  const pose at = {{0.0, 2.0, 0.0}, {0.7071067811865476, 0.0, 0.0, 0.7071067811865476}}; /* a quarter turn about z */
  const double click_m[3] = {0.0, 1.9, 0.05};
  char message[512];
  carillon_bank* bank = NULL;
  carillon_model* model = NULL;
  carillon_synth* synth = NULL;
  carillon_model_options model_options;
  carillon_options options;
  carillon_body_options body_options;
  carillon_impulse strike;
  float left[128], right[128];
  float* out[2];
  float peak = 0.0f;
  int32_t body = -1;
  int block, n, k;

  if (argc != 2) return fail("usage: click_c BANK");
  if (carillon_bank_open(argv[1], &bank, message, sizeof message) != CARILLON_OK) return fail(message);
  carillon_model_options_init(&model_options);
  if (carillon_model_make(bank, &model_options, &model, message, sizeof message) != CARILLON_OK) return fail(message);
  carillon_options_init(&options);
  if (carillon_create(&options, &synth, message, sizeof message) != CARILLON_OK) return fail(message);
  carillon_body_options_init(&body_options);
  for (k = 0; k < 3; ++k) body_options.position_m[k] = at.position_m[k];
  for (k = 0; k < 4; ++k) body_options.rotation[k] = at.rotation[k];
  if (carillon_add_body_with(synth, model, &body_options, &body, message, sizeof message) != CARILLON_OK) return fail(message);

  carillon_impulse_init(&strike);
  strike.body = body;
  strike.time_s = 0.01;
  strike.duration_s = 1e-4;
  if (make_strike(bank, &at, click_m, 0.01, &strike) != CARILLON_OK) return fail("the clicked point is not finite or too far away");
  if (carillon_push_impulse(synth, &strike) != CARILLON_OK) return fail("the strike cannot be played");

  out[0] = left;
  out[1] = right;
  for (block = 0; block < 375; ++block) { /* one second */
    carillon_process(synth, out, 2, 128);
    for (n = 0; n < 128; ++n) {
      const float pressure = left[n] < 0 ? -left[n] : left[n];
      if (pressure > peak) peak = pressure;
    }
  }
  printf("triangle %d of %d, peak %g Pa at the left ear\n", (int)strike.triangle, (int)carillon_bank_triangle_count(bank), (double)peak);

  carillon_destroy(synth);
  carillon_model_release(model);
  carillon_bank_close(bank);
  return peak > 0.0f ? 0 : 1;
}
