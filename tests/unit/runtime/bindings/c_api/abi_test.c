/* Every function of carillon.h, with good and with bad arguments: one list, as the header is; longer than most files. */
#include <carillon.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int failures = 0;

#define CHECK(condition)                                              \
  do {                                                                \
    if (!(condition)) {                                               \
      fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
      ++failures;                                                     \
    }                                                                 \
  } while (0)

static char message[256];

static void* read_file(const char* name, size_t* size) {
  FILE* file = fopen(name, "rb");
  void* bytes;
  if (file == NULL) exit(2);
  fseek(file, 0, SEEK_END);
  *size = (size_t)ftell(file);
  rewind(file);
  bytes = malloc(*size);
  if (bytes == NULL || fread(bytes, 1, *size, file) != *size) exit(2);
  fclose(file);
  return bytes;
}

static void check_banks(const char* name, carillon_bank** bank) {
  size_t size;
  char* bytes = read_file(name, &size);
  carillon_bank* other = (carillon_bank*)1;
  char small[8];
  CHECK(carillon_bank_open(name, bank, message, sizeof message) == CARILLON_OK);
  CHECK(message[0] == '\0');
  CHECK(carillon_bank_parse(bytes, size, &other, NULL, 0) == CARILLON_OK);
  CHECK(carillon_bank_mode_count(other) == carillon_bank_mode_count(*bank) && carillon_bank_mode_count(other) > 0);
  CHECK(carillon_bank_triangle_count(other) > 0);
  CHECK(carillon_bank_frequency_hz(other, 0) == carillon_bank_frequency_hz(*bank, 0) && carillon_bank_frequency_hz(other, 0) > 0);
  CHECK(carillon_bank_frequency_hz(other, -1) == 0 && carillon_bank_frequency_hz(other, 1 << 30) == 0);
  carillon_bank_close(other);
  bytes[size / 2] ^= 1;
  CHECK(carillon_bank_parse(bytes, size, &other, message, sizeof message) == CARILLON_BAD_INPUT);
  CHECK(other == NULL && strlen(message) > 10);
  CHECK(carillon_bank_parse(bytes, 10, &other, small, sizeof small) == CARILLON_BAD_INPUT);
  CHECK(strlen(small) == sizeof small - 1);
  CHECK(carillon_bank_open("/nowhere", &other, message, sizeof message) == CARILLON_BAD_INPUT && strstr(message, "/nowhere") != NULL);
  CHECK(carillon_bank_open(NULL, &other, message, sizeof message) == CARILLON_BAD_ARGUMENT && strlen(message) > 10);
  CHECK(carillon_bank_open(name, NULL, NULL, 0) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_bank_parse(NULL, 5, &other, NULL, 0) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_bank_mode_count(NULL) == 0 && carillon_bank_triangle_count(NULL) == 0);
  carillon_bank_close(NULL);
  free(bytes);
}

/* A bank with corrected frequencies: they are the default, and each way to read it gives either. */
static void check_frequencies(const char* name) {
  size_t size;
  void* bytes = read_file(name, &size);
  carillon_bank *plain = NULL, *opened = NULL, *parsed = NULL;
  int32_t way, mode, differ = 0;
  CHECK(carillon_bank_open(name, &plain, message, sizeof message) == CARILLON_OK);
  for (way = CARILLON_FREQUENCIES_CORRECTED; way <= CARILLON_FREQUENCIES_MESH; ++way) {
    CHECK(carillon_bank_open_as(name, way, &opened, message, sizeof message) == CARILLON_OK && message[0] == '\0');
    CHECK(carillon_bank_parse_as(bytes, size, way, &parsed, NULL, 0) == CARILLON_OK);
    CHECK(carillon_bank_mode_count(opened) == carillon_bank_mode_count(plain) && carillon_bank_mode_count(plain) > 0);
    for (mode = 0; mode < carillon_bank_mode_count(plain); ++mode) {
      const double hz = carillon_bank_frequency_hz(opened, mode);
      CHECK(hz == carillon_bank_frequency_hz(parsed, mode));
      CHECK(mode == 0 || hz >= carillon_bank_frequency_hz(opened, mode - 1));
      CHECK(way == CARILLON_FREQUENCIES_MESH || hz == carillon_bank_frequency_hz(plain, mode));
      differ += hz != carillon_bank_frequency_hz(plain, mode);
    }
    carillon_bank_close(opened);
    carillon_bank_close(parsed);
  }
  CHECK(differ > 0);
  for (way = -1; way <= 2; way += 3) {
    CHECK(carillon_bank_open_as(name, way, &opened, message, sizeof message) == CARILLON_BAD_INPUT && opened == NULL);
    CHECK(strstr(message, "carillon_frequencies") != NULL);
    CHECK(carillon_bank_parse_as(bytes, size, way, &parsed, message, sizeof message) == CARILLON_BAD_INPUT && parsed == NULL);
  }
  CHECK(carillon_bank_open_as(NULL, 0, &opened, message, sizeof message) == CARILLON_BAD_ARGUMENT && opened == NULL);
  CHECK(carillon_bank_parse_as(bytes, size, 0, NULL, message, sizeof message) == CARILLON_BAD_ARGUMENT);
  carillon_bank_close(plain);
  free(bytes);
}

/* The nearest point of a triangle by brute force, and the barycentric coordinates as carillon_impulse has them. */
static void check_nearest(const carillon_bank* bank) {
  const int32_t vertices = carillon_bank_vertex_count(bank), triangles = carillon_bank_triangle_count(bank);
  const double* x = carillon_bank_vertices_m(bank);
  const int32_t* corner = carillon_bank_triangles(bank);
  double low[3], high[3], point[3], weight[3], closest[3], centre[3], distance;
  double bad[3] = {0, 0, 0};
  int32_t triangle, i, j;
  int k, n;
  CHECK(vertices > 3 && x != NULL && corner != NULL);
  for (k = 0; k < 3; ++k) low[k] = high[k] = x[k];
  for (i = 0; i < vertices; ++i) {
    for (k = 0; k < 3; ++k) {
      low[k] = fmin(low[k], x[3 * i + k]);
      high[k] = fmax(high[k], x[3 * i + k]);
    }
  }
  for (i = 0; i < 3 * triangles; ++i) CHECK(corner[i] >= 0 && corner[i] < vertices);
  carillon_bank_centre_m(bank, centre);
  for (k = 0; k < 3; ++k) CHECK(centre[k] > low[k] && centre[k] < high[k]);
  for (n = 0; n < 200; ++n) {
    double min = INFINITY, from[3];
    for (k = 0; k < 3; ++k) point[k] = low[k] + (high[k] - low[k]) * (1.6 * ((n * (37 + 22 * k) + 11) % 101) / 101.0 - 0.3);
    CHECK(carillon_bank_nearest_point(bank, point, &triangle, weight, closest, &distance) == CARILLON_OK);
    CHECK(triangle >= 0 && triangle < triangles && fabs(weight[0] + weight[1] + weight[2] - 1) < 1e-12);
    for (k = 0; k < 3; ++k) {
      CHECK(weight[k] >= 0);
      from[k] = 0;
      for (j = 0; j < 3; ++j) from[k] += weight[j] * x[3 * corner[3 * triangle + j] + k];
      CHECK(fabs(from[k] - closest[k]) < 1e-12);
      from[k] -= point[k];
    }
    CHECK(fabs(sqrt(from[0] * from[0] + from[1] * from[1] + from[2] * from[2]) - distance) < 1e-12);
    for (i = 0; i < triangles; ++i) { /* every triangle on a grid */
      int a, b;
      for (a = 0; a <= 6; ++a) {
        for (b = 0; a + b <= 6; ++b) {
          double square = 0;
          for (k = 0; k < 3; ++k) {
            const double at =
                (a * x[3 * corner[3 * i] + k] + b * x[3 * corner[3 * i + 1] + k] + (6 - a - b) * x[3 * corner[3 * i + 2] + k]) / 6;
            square += (at - point[k]) * (at - point[k]);
          }
          min = fmin(min, sqrt(square));
        }
      }
    }
    CHECK(distance <= min + 1e-12);
  }
  CHECK(carillon_bank_nearest_point(bank, x, &triangle, weight, NULL, NULL) == CARILLON_OK && triangle >= 0);
  for (k = 0; k < 3; ++k) {
    for (n = 0; n < 4; ++n) {
      bad[k] = n == 0 ? NAN : n == 1 ? INFINITY : n == 2 ? -INFINITY : 1e200;
      CHECK(carillon_bank_nearest_point(bank, bad, &triangle, weight, closest, &distance) == CARILLON_BAD_INPUT && triangle == -1);
    }
    bad[k] = 0;
  }
  CHECK(carillon_bank_nearest_point(NULL, point, &triangle, weight, closest, &distance) == CARILLON_BAD_ARGUMENT && triangle == -1);
  CHECK(carillon_bank_nearest_point(bank, NULL, &triangle, weight, closest, &distance) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_bank_nearest_point(bank, point, NULL, weight, closest, &distance) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_bank_nearest_point(bank, point, &triangle, NULL, closest, &distance) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_bank_vertex_count(NULL) == 0 && carillon_bank_vertices_m(NULL) == NULL && carillon_bank_triangles(NULL) == NULL);
  {
    carillon_body_facts facts;
    carillon_body_facts_init(&facts);
    CHECK(facts.size == sizeof facts && facts.mass_kg == 0);
    CHECK(carillon_bank_get_facts(bank, &facts) == CARILLON_OK);
    CHECK(facts.mass_kg > 0 && fabs(facts.mass_kg - facts.density_kg_m3 * facts.volume_m3) < 1e-6 * facts.mass_kg);
    CHECK(facts.young_modulus_pa > 0 && facts.poisson_ratio > -1 && facts.poisson_ratio < 0.5);
    CHECK(facts.inertia_kg_m2[0] > 0 && facts.inertia_kg_m2[1] == facts.inertia_kg_m2[3]);
    facts.size = 4;
    CHECK(carillon_bank_get_facts(bank, &facts) == CARILLON_BAD_ARGUMENT);
    CHECK(carillon_bank_get_facts(NULL, &facts) == CARILLON_BAD_ARGUMENT && carillon_bank_get_facts(bank, NULL) == CARILLON_BAD_ARGUMENT);
  }
  carillon_bank_centre_m(NULL, centre);
  CHECK(centre[0] == 0 && centre[1] == 0 && centre[2] == 0);
  carillon_bank_centre_m(bank, NULL);
}

static void check_variation(const carillon_bank* bank) {
  carillon_impulse first, other, same;
  double energy = 0;
  int32_t n;
  int k;
  CHECK(carillon_name_seed("") == 0xcbf29ce484222325ull && carillon_name_seed("a") == 0xaf63dc4c8601ec8cull); /* published: FNV-1a */
  CHECK(carillon_name_seed(NULL) == 0);
  carillon_impulse_init(&first);
  first.time_s = 1;
  first.duration_s = 1e-4;
  first.impulse_n_s[2] = 0.01;
  for (k = 0; k < 3; ++k) first.barycentric[k] = 1.0 / 3.0;
  other = first;
  CHECK(carillon_vary_impulse(bank, 0, 5, 7, &other) == CARILLON_OK && memcmp(&first, &other, sizeof first) == 0); /* off: to the bit */
  for (n = 0; n < 1000; ++n) {
    double size = 0, weight = 0;
    other = same = first;
    CHECK(carillon_vary_impulse(bank, 1, carillon_name_seed("bell"), n, &other) == CARILLON_OK);
    CHECK(carillon_vary_impulse(bank, 1, carillon_name_seed("bell"), n, &same) == CARILLON_OK && memcmp(&same, &other, sizeof same) == 0);
    CHECK(memcmp(&first, &other, sizeof first) != 0);
    for (k = 0; k < 3; ++k) {
      size += other.impulse_n_s[k] * other.impulse_n_s[k];
      weight += other.barycentric[k];
      CHECK(other.barycentric[k] >= 0);
    }
    CHECK(fabs(weight - 1) < 1e-12 && other.triangle >= 0 && other.triangle < carillon_bank_triangle_count(bank));
    CHECK(other.time_s == first.time_s && other.duration_s > 0.7e-4 && other.duration_s < 1.3e-4);
    CHECK(sqrt(size) > 0.005 && sqrt(size) < 0.014);
    energy += size / 1e-4 / 1000;
  }
  CHECK(fabs(energy - 1) < 4 * 0.18 / sqrt(1000)); /* the mean energy stays: four standard errors */
  same = first;
  CHECK(carillon_vary_impulse(bank, 1, carillon_name_seed("gong"), 999, &same) == CARILLON_OK && memcmp(&same, &other, sizeof same) != 0);
  other = first;
  CHECK(carillon_vary_impulse(bank, 1.1, 0, 0, &other) == CARILLON_BAD_INPUT &&
        carillon_vary_impulse(bank, -1, 0, 0, &other) == CARILLON_BAD_INPUT);
  CHECK(carillon_vary_impulse(bank, nan(""), 0, 0, &other) == CARILLON_BAD_INPUT && memcmp(&first, &other, sizeof first) == 0);
  other.triangle = carillon_bank_triangle_count(bank);
  CHECK(carillon_vary_impulse(bank, 1, 0, 0, &other) == CARILLON_BAD_INPUT);
  other.triangle = -1;
  CHECK(carillon_vary_impulse(bank, 1, 0, 0, &other) == CARILLON_BAD_INPUT);
  other = first;
  other.impulse_n_s[1] = INFINITY;
  CHECK(carillon_vary_impulse(bank, 1, 0, 0, &other) == CARILLON_BAD_INPUT);
  CHECK(carillon_vary_impulse(NULL, 1, 0, 0, &first) == CARILLON_BAD_ARGUMENT &&
        carillon_vary_impulse(bank, 1, 0, 0, NULL) == CARILLON_BAD_ARGUMENT);
}

static void check_models(const carillon_bank* bank, carillon_model** model) {
  carillon_model_options options;
  carillon_model* other;
  carillon_model_options_init(&options);
  carillon_model_options_init(NULL);
  CHECK(options.radiation == CARILLON_RADIATION_AUTO);
  CHECK(carillon_model_make(bank, &options, model, message, sizeof message) == CARILLON_OK);
  CHECK(carillon_model_mode_count(*model) > 0 && carillon_model_mode_count(*model) <= carillon_bank_mode_count(bank));
  options.radiation = CARILLON_RADIATION_OSG02;
  CHECK(carillon_model_make(bank, &options, &other, NULL, 0) == CARILLON_OK);
  carillon_model_release(other);
  options.radiation = 77;
  CHECK(carillon_model_make(bank, &options, &other, NULL, 0) == CARILLON_BAD_ARGUMENT && other == NULL);
  options.radiation = -1;
  CHECK(carillon_model_make(bank, &options, &other, NULL, 0) == CARILLON_BAD_ARGUMENT && other == NULL);
  options.radiation = 0;
  options.rate_hz = -1;
  CHECK(carillon_model_make(bank, &options, &other, message, sizeof message) == CARILLON_BAD_INPUT && other == NULL && message[0] != '\0');
  options.size = 0;
  CHECK(carillon_model_make(bank, &options, &other, NULL, 0) == CARILLON_BAD_ARGUMENT);
  carillon_model_options_init_sized(&options, sizeof options - 8); /* smaller than it ever was: not touched */
  CHECK(options.size == 0);
  CHECK(carillon_model_make(NULL, NULL, NULL, NULL, 0) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_model_mode_count(NULL) == 0);
  carillon_model_release(NULL);
}

static void check_edits(const carillon_bank* bank) {
  carillon_edits edits;
  carillon_bank* edited = (carillon_bank*)1;
  double factor;
  carillon_edits_init(&edits);
  carillon_edits_init(NULL);
  edits.density_scale = 2;
  edits.stiffness_scale = 3;
  edits.size_scale = 0.5;
  CHECK(carillon_bank_edit(bank, &edits, &edited, message, sizeof message) == CARILLON_OK && edited != NULL);
  factor = sqrt(3.0 / 2.0) / 0.5;
  CHECK(fabs(carillon_bank_frequency_hz(edited, 0) - factor * carillon_bank_frequency_hz(bank, 0)) <
        1e-9 * carillon_bank_frequency_hz(bank, 0));
  carillon_bank_close(edited);
  edits.sets_damping = 1;
  edits.alpha1_s = -1;
  CHECK(carillon_bank_edit(bank, &edits, &edited, message, sizeof message) == CARILLON_BAD_INPUT && edited == NULL && message[0] != '\0');
  edits.sets_damping = 0;
  edits.size_scale = NAN;
  CHECK(carillon_bank_edit(bank, &edits, &edited, message, sizeof message) == CARILLON_BAD_INPUT && edited == NULL);
  edits.size = 1;
  CHECK(carillon_bank_edit(bank, &edits, &edited, NULL, 0) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_bank_edit(NULL, &edits, &edited, NULL, 0) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_bank_edit(bank, NULL, &edited, NULL, 0) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_bank_edit(bank, &edits, NULL, NULL, 0) == CARILLON_BAD_ARGUMENT);
}

static float play(carillon_synth* synth, int blocks) {
  float left[64], right[64];
  float* out[2];
  float peak = 0;
  int n;
  out[0] = left;
  out[1] = right;
  for (; blocks > 0; --blocks) {
    carillon_process(synth, out, 2, 64);
    for (n = 0; n < 64; ++n) peak = fmaxf(peak, fmaxf(fabsf(left[n]), fabsf(right[n])));
  }
  return peak;
}

static void check_events(carillon_synth* synth, int32_t body) {
  carillon_impulse impulse;
  carillon_motion motion;
  carillon_listener listener;
  carillon_impulse_init(&impulse);
  carillon_motion_init(&motion);
  carillon_listener_init(&listener);
  carillon_impulse_init(NULL);
  carillon_motion_init(NULL);
  carillon_listener_init(NULL);
  impulse.body = motion.body = body;
  motion.position_m[1] = 1;
  impulse.time_s = carillon_horizon_s(synth) + 0.001;
  impulse.duration_s = 1e-4;
  impulse.impulse_n_s[0] = impulse.impulse_n_s[2] = 0.01;
  CHECK(carillon_push_motion(synth, &motion) == CARILLON_OK);
  CHECK(carillon_push_listener(synth, &listener) == CARILLON_OK);
  CHECK(carillon_push_impulse(synth, &impulse) == CARILLON_OK);
  CHECK(play(synth, 100) > 0);
  impulse.gaussian = 1;
  impulse.time_s = carillon_horizon_s(synth) + 0.001;
  CHECK(carillon_push_impulse(synth, &impulse) == CARILLON_OK);
  impulse.impulse_n_s[1] = nan("");
  CHECK(carillon_push_impulse(synth, &impulse) == CARILLON_BAD_INPUT);
  motion.position_m[0] = INFINITY;
  CHECK(carillon_push_motion(synth, &motion) == CARILLON_BAD_INPUT);
  listener.velocity_m_s[2] = -INFINITY;
  CHECK(carillon_push_listener(synth, &listener) == CARILLON_BAD_INPUT);
  impulse.size = 3;
  CHECK(carillon_push_impulse(synth, &impulse) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_push_impulse(synth, NULL) == CARILLON_BAD_ARGUMENT && carillon_push_impulse(NULL, &impulse) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_push_motion(synth, NULL) == CARILLON_BAD_ARGUMENT && carillon_push_motion(NULL, &motion) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_push_listener(synth, NULL) == CARILLON_BAD_ARGUMENT && carillon_push_listener(NULL, &listener) == CARILLON_BAD_ARGUMENT);
}

static void check_forces(const carillon_model* model) {
  static const double place[3] = {0, 1, 0};
  double steps[40][3];
  carillon_options options;
  carillon_synth* synth;
  int32_t body;
  carillon_force force;
  carillon_counters before, after;
  int k;
  carillon_counters_init(&before);
  carillon_counters_init(&after);
  carillon_force_init(&force);
  carillon_force_init(NULL);
  carillon_options_init(&options);
  CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_OK);
  CHECK(carillon_add_body(synth, model, place, &body, NULL, 0) == CARILLON_OK);
  CHECK(carillon_get_counters(synth, &before) == CARILLON_OK);
  CHECK(carillon_push_force(synth, &force) == CARILLON_BAD_ARGUMENT);
  for (k = 0; k < 40; ++k) {
    steps[k][0] = steps[k][1] = 0;
    steps[k][2] = 1e-4 * (k + 1);
  }
  force.body = body;
  force.time_s = carillon_horizon_s(synth) + 0.001;
  force.step_s = 2.5e-6;
  force.impulse_n_s = (const double(*)[3])steps;
  force.count = 40;
  CHECK(carillon_push_force(synth, &force) == CARILLON_OK);
  CHECK(play(synth, 100) > 0);
  CHECK(carillon_get_counters(synth, &after) == CARILLON_OK);
  CHECK(after.strikes == before.strikes + 1 && after.late == before.late && after.refused == before.refused);
  steps[39][1] = nan("");
  CHECK(carillon_push_force(synth, &force) == CARILLON_BAD_INPUT);
  (void)play(synth, 2);
  CHECK(carillon_get_counters(synth, &after) == CARILLON_OK);
  CHECK(after.strikes == before.strikes + 1 && after.faults == before.faults + 1);
  steps[39][1] = 0;
  force.step_s = 0;
  CHECK(carillon_push_force(synth, &force) == CARILLON_BAD_INPUT);
  force.step_s = 1e-5;
  force.count = 0;
  CHECK(carillon_push_force(synth, &force) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_push_force(synth, NULL) == CARILLON_BAD_ARGUMENT && carillon_push_force(NULL, &force) == CARILLON_BAD_ARGUMENT);
  carillon_destroy(synth);
}

static void check_contacts(const carillon_model* model) {
  static const double place[3] = {0, 1, 0};
  carillon_options options;
  carillon_synth* synth;
  carillon_contact contact;
  carillon_counters counters;
  int32_t body;
  carillon_options_init(&options);
  CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_OK);
  CHECK(carillon_add_body(synth, model, place, &body, NULL, 0) == CARILLON_OK);
  carillon_contact_init(&contact);
  carillon_contact_init(NULL);
  contact.body = body;
  contact.id = 7;
  contact.force_n = 2;
  contact.slip_m_s[0] = contact.sweep_m_s = contact.other_sweep_m_s = 0.3;
  contact.state = CARILLON_CONTACT_BEGIN;
  CHECK(carillon_push_contact(synth, &contact) == CARILLON_OK);
  contact.state = CARILLON_CONTACT_HOLD;
  contact.time_s = 0.1;
  CHECK(carillon_push_contact(synth, &contact) == CARILLON_OK);
  contact.state = CARILLON_CONTACT_END;
  contact.time_s = 0.2;
  CHECK(carillon_push_contact(synth, &contact) == CARILLON_OK);
  CHECK(carillon_push_mark(synth, 0.5) == CARILLON_OK);
  (void)play(synth, 300);
  contact.state = 3;
  CHECK(carillon_push_contact(synth, &contact) == CARILLON_BAD_INPUT);
  contact.state = CARILLON_CONTACT_HOLD;
  contact.force_n = -1;
  CHECK(carillon_push_contact(synth, &contact) == CARILLON_BAD_INPUT);
  contact.force_n = NAN;
  CHECK(carillon_push_contact(synth, &contact) == CARILLON_BAD_INPUT);
  contact.size = 8;
  CHECK(carillon_push_contact(synth, &contact) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_push_contact(synth, NULL) == CARILLON_BAD_ARGUMENT && carillon_push_contact(NULL, &contact) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_push_mark(synth, NAN) == CARILLON_BAD_INPUT && carillon_push_mark(NULL, 1) == CARILLON_BAD_ARGUMENT);
  carillon_counters_init(&counters);
  carillon_counters_init(NULL);
  CHECK(carillon_get_counters(synth, &counters) == CARILLON_OK && counters.underruns == 0 && counters.faults == 3);
  /* A body has no effects of contacts unless it asks for them. */
  CHECK(counters.contacts_without_use == 3 && counters.contacts_accepted == 0);
  (void)play(synth, 200); /* beyond the mark */
  CHECK(carillon_get_counters(synth, &counters) == CARILLON_OK && counters.underruns == 1);
  carillon_destroy(synth);
}

/* The peak of a body that slides over ground as rough as itself. */
static float slide(const carillon_model* model, uint32_t effects, double roughness_m) {
  carillon_options options;
  carillon_body_options body_options;
  carillon_synth* synth;
  carillon_contact contact;
  int32_t body;
  int i;
  float peak;
  carillon_options_init(&options);
  options.ground_roughness_m = roughness_m;
  CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_OK);
  carillon_body_options_init(&body_options);
  body_options.position_m[1] = 1;
  body_options.effects |= effects;
  body_options.roughness_m = roughness_m;
  CHECK(carillon_add_body_with(synth, model, &body_options, &body, message, sizeof message) == CARILLON_OK);
  carillon_contact_init(&contact);
  contact.body = body;
  contact.id = 7;
  contact.normal[0] = 0;
  contact.normal[1] = 0;
  contact.normal[2] = 1;
  contact.force_n = 2;
  contact.patch_radius_m = 1e-4;
  contact.slip_m_s[0] = contact.sweep_m_s = contact.other_sweep_m_s = 0.3;
  for (i = 0; i <= 20; ++i) {
    contact.state = i == 0 ? CARILLON_CONTACT_BEGIN : i == 20 ? CARILLON_CONTACT_END : CARILLON_CONTACT_HOLD;
    contact.time_s = 0.01 * i;
    CHECK(carillon_push_contact(synth, &contact) == CARILLON_OK);
  }
  CHECK(carillon_push_mark(synth, 0.5) == CARILLON_OK);
  peak = play(synth, 200);
  carillon_destroy(synth);
  return peak;
}

/* Records of lasting contacts are counted by what becomes of them: nine touches where there is room for eight, one of no triangle. */
static void check_contact_counters(const carillon_model* model) {
  const double place[3] = {0, 1, 0};
  carillon_options options;
  carillon_body_options body_options;
  carillon_counters counters;
  carillon_contact contact;
  carillon_synth* synth;
  int32_t body;
  int i;
  carillon_options_init(&options);
  CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_OK);
  carillon_body_options_init(&body_options);
  body_options.effects |= CARILLON_ROUGHNESS;
  for (i = 0; i < 3; ++i) body_options.position_m[i] = place[i];
  CHECK(carillon_add_body_with(synth, model, &body_options, &body, message, sizeof message) == CARILLON_OK);
  (void)play(synth, 1);
  carillon_contact_init(&contact);
  CHECK(contact.impedance_n_s_m == CARILLON_BY_MATERIAL);
  contact.body = body;
  contact.force_n = 1;
  for (i = 1; i <= 9; ++i) {
    contact.id = (uint64_t)i;
    CHECK(carillon_push_contact(synth, &contact) == CARILLON_OK);
  }
  contact.triangle = 1 << 30;
  CHECK(carillon_push_contact(synth, &contact) == CARILLON_OK);
  contact.impedance_n_s_m = -2;
  CHECK(carillon_push_contact(synth, &contact) == CARILLON_BAD_INPUT);
  (void)play(synth, 2);
  carillon_counters_init(&counters);
  CHECK(carillon_get_counters(synth, &counters) == CARILLON_OK);
  CHECK(counters.contacts_accepted == 8 && counters.contacts_dropped == 1 && counters.contacts_refused == 1);
  CHECK(counters.contacts_thinned == 0 && counters.contacts_without_use == 0);
  carillon_destroy(synth);
}

static void check_surfaces(const carillon_model* model) {
  const float rough = slide(model, CARILLON_ROUGHNESS, 5e-6);
  check_contact_counters(model);
  CHECK(rough > 0);
  CHECK(slide(model, CARILLON_ROUGHNESS, 5e-9) < 0.5F * rough);
  CHECK(slide(model, CARILLON_ROUGHNESS, 0) == 0);
  CHECK(slide(model, 0, 5e-6) == 0);
}

static void check_bodies(const carillon_bank* bank, const carillon_model* model) {
  carillon_options options;
  carillon_synth* synth;
  carillon_body_options body_options;
  carillon_model_options model_options;
  carillon_edits edits;
  carillon_bank* edited;
  carillon_model* other;
  carillon_impulse impulse;
  carillon_counters counters;
  carillon_effect_counters effects;
  int32_t body, second;
  int i;
  carillon_options_init(&options);
  options.max_bodies = 2;
  options.budget = 16 * 48000.0;
  CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_OK);
  CHECK(carillon_get_budget(synth) == 16 * 48000.0 && carillon_get_budget(NULL) == 0);
  carillon_body_options_init(&body_options);
  carillon_body_options_init(NULL);
  CHECK((body_options.effects & CARILLON_MODAL) != 0 && (body_options.effects & CARILLON_ACCELERATION_NOISE) == 0);
  body_options.position_m[1] = 1;
  body_options.effects = CARILLON_MODAL | CARILLON_HERTZ_PULSE | CARILLON_TWO_EARS;
  CHECK(carillon_add_body_with(synth, model, &body_options, &body, message, sizeof message) == CARILLON_OK && body == 0);
  CHECK(carillon_get_effects(synth, body) == body_options.effects);
  CHECK(carillon_get_effects(synth, 77) == 0 && carillon_get_effects(NULL, 0) == 0);
  body_options.effects = 1 << 20;
  CHECK(carillon_add_body_with(synth, model, &body_options, &second, message, sizeof message) == CARILLON_BAD_INPUT && message[0] != '\0');
  body_options.effects = 512;
  CHECK(carillon_add_body_with(synth, model, &body_options, &second, message, sizeof message) == CARILLON_BAD_INPUT && second == -1);
  body_options.effects = CARILLON_MODAL;
  body_options.rotation[0] = 0;
  CHECK(carillon_add_body_with(synth, model, &body_options, &second, message, sizeof message) == CARILLON_BAD_INPUT);
  body_options.rotation[0] = NAN;
  CHECK(carillon_add_body_with(synth, model, &body_options, &second, message, sizeof message) == CARILLON_BAD_INPUT);
  body_options.rotation[0] = 1;
  body_options.silence_pa = -1;
  CHECK(carillon_add_body_with(synth, model, &body_options, &second, message, sizeof message) == CARILLON_BAD_INPUT);
  body_options.silence_pa = 1e-10;
  body_options.roughness_m = -1e-6;
  CHECK(carillon_add_body_with(synth, model, &body_options, &second, message, sizeof message) == CARILLON_BAD_INPUT &&
        strstr(message, "roughness") != NULL);
  body_options.size = 0;
  CHECK(carillon_add_body_with(synth, model, &body_options, &second, NULL, 0) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_add_body_with(NULL, NULL, NULL, NULL, NULL, 0) == CARILLON_BAD_ARGUMENT);

  carillon_edits_init(&edits);
  edits.size_scale = 1.3;
  CHECK(carillon_bank_edit(bank, &edits, &edited, NULL, 0) == CARILLON_OK);
  carillon_model_options_init(&model_options);
  CHECK(carillon_model_make(edited, &model_options, &other, NULL, 0) == CARILLON_OK);
  carillon_bank_close(edited);
  carillon_impulse_init(&impulse);
  impulse.impulse_n_s[0] = impulse.impulse_n_s[2] = 0.01;
  impulse.duration_s = 1e-4;
  for (i = 0; i < 20; ++i) {
    impulse.time_s = carillon_horizon_s(synth) + 0.001;
    CHECK(carillon_push_impulse(synth, &impulse) == CARILLON_OK);
    CHECK(carillon_swap_model(synth, body, i % 2 ? model : other, message, sizeof message) == CARILLON_OK);
    CHECK(play(synth, 7) > 0);
    CHECK(carillon_keep_load(synth, 0.3, 0.001 * i) == CARILLON_OK);
  }
  carillon_model_release(other); /* the body keeps it */
  CHECK(play(synth, 7) > 0);
  model_options.rate_hz = 32000;
  CHECK(carillon_model_make(bank, &model_options, &other, NULL, 0) == CARILLON_OK);
  CHECK(carillon_swap_model(synth, body, other, message, sizeof message) == CARILLON_BAD_INPUT && message[0] != '\0');
  carillon_model_release(other);
  CHECK(carillon_swap_model(synth, 9, model, message, sizeof message) == CARILLON_BAD_INPUT);
  CHECK(carillon_swap_model(NULL, body, model, NULL, 0) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_swap_model(synth, body, NULL, NULL, 0) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_keep_load(NULL, 0.3, 1) == CARILLON_BAD_ARGUMENT && carillon_keep_load(synth, 0, 1) == CARILLON_BAD_INPUT);
  CHECK(carillon_keep_load(synth, NAN, 1) == CARILLON_BAD_INPUT && carillon_keep_load(synth, 0.5, NAN) == CARILLON_BAD_INPUT);
  carillon_set_budget(synth, INFINITY);
  carillon_set_budget(NULL, 1);
  CHECK(carillon_get_budget(synth) == INFINITY);

  carillon_effect_counters_init(&effects);
  carillon_effect_counters_init(NULL);
  CHECK(carillon_get_effect_counters(synth, body, &effects) == CARILLON_OK && effects.units[0] > 0);
  CHECK(effects.units[5] == 0 && effects.later_units[0] == 0 && effects.later_units[1] == 0);
  CHECK(carillon_get_effect_counters(synth, 99, &effects) == CARILLON_OK && effects.units[0] == 0);
  CHECK(carillon_get_effect_counters(synth, body, NULL) == CARILLON_BAD_ARGUMENT &&
        carillon_get_effect_counters(NULL, 0, &effects) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_deflection(synth, body) == 0 && carillon_deflection(synth, -1) == 0 && carillon_deflection(NULL, 0) == 0);
  CHECK(carillon_peak_pa(synth, body) > 0 && carillon_peak_pa(synth, -1) == 0 && carillon_peak_pa(NULL, 0) == 0);

  /* No number of the output is none, whatever comes. */
  carillon_set_gain(synth, NAN);
  CHECK(play(synth, 4) == 0);
  carillon_set_gain(synth, 1e38);
  impulse.impulse_n_s[0] = 1e300;
  impulse.time_s = carillon_horizon_s(synth) + 0.001;
  CHECK(carillon_push_impulse(synth, &impulse) == CARILLON_OK);
  CHECK(isfinite(play(synth, 40)));
  carillon_counters_init(&counters);
  CHECK(carillon_get_counters(synth, &counters) == CARILLON_OK && counters.resets >= 1);
  carillon_destroy(synth);
}

static void check_synth(const carillon_model* model) {
  static const double place[3] = {0, 1, 0}, nowhere[3] = {0, NAN, 0};
  static const double microphones[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 0, 1}};
  carillon_options options;
  carillon_synth* synth;
  carillon_synth* other;
  carillon_counters counters;
  carillon_motion motion;
  int32_t body, second;
  int i;
  carillon_options_init(&options);
  carillon_options_init(NULL);
  options.max_bodies = 2;
  options.ring_events = 16;
  CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_OK);
  CHECK(carillon_time_s(synth) == 0);
  CHECK(carillon_add_body(synth, model, place, &body, message, sizeof message) == CARILLON_OK && body == 0);
  CHECK(carillon_add_body(synth, model, nowhere, &second, message, sizeof message) == CARILLON_BAD_INPUT && second == -1);
  CHECK(carillon_add_body(synth, model, place, &second, NULL, 0) == CARILLON_OK && second == 1);
  CHECK(carillon_add_body(synth, model, place, &second, message, sizeof message) == CARILLON_FULL && second == -1 && message[0] != '\0');
  CHECK(carillon_add_body(synth, NULL, place, &second, NULL, 0) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_add_body(NULL, NULL, NULL, NULL, NULL, 0) == CARILLON_BAD_ARGUMENT);
  check_events(synth, body);
  carillon_set_gain(synth, 0);
  carillon_set_gain(NULL, 1);
  CHECK(play(synth, 10) == 0);
  carillon_set_gain(synth, 1);
  CHECK(play(synth, 10) > 0);
  CHECK(fabs(carillon_time_s(synth) - 120 * 64 / 48000.0) < 1e-12 && carillon_horizon_s(synth) >= carillon_time_s(synth));
  CHECK(carillon_remove_body(synth, body) == CARILLON_OK);
  CHECK(carillon_remove_body(synth, body) == CARILLON_BAD_INPUT);
  CHECK(carillon_remove_body(synth, -4) == CARILLON_BAD_INPUT && carillon_remove_body(NULL, 0) == CARILLON_BAD_ARGUMENT);
  (void)play(synth, 4);
  carillon_collect(synth);
  carillon_collect(NULL);
  CHECK(carillon_add_body(synth, model, place, &second, NULL, 0) == CARILLON_OK && second == body);

  carillon_motion_init(&motion);
  for (i = 0; i < 16; ++i) CHECK(carillon_push_motion(synth, &motion) == CARILLON_OK);
  CHECK(carillon_push_motion(synth, &motion) == CARILLON_FULL);
  (void)play(synth, 1);
  counters.size = sizeof counters;
  CHECK(carillon_get_counters(synth, &counters) == CARILLON_OK);
  CHECK(counters.strikes == 2 && counters.faults == 3 && counters.overflows == 1 && counters.late == 0 && counters.resets == 0);
  CHECK(counters.mode_samples > 0);
  counters.size = 4;
  CHECK(carillon_get_counters(synth, &counters) == CARILLON_BAD_ARGUMENT && carillon_get_counters(NULL, NULL) == CARILLON_BAD_ARGUMENT);
  carillon_process(synth, NULL, 2, 64);
  carillon_process(NULL, NULL, 2, 64);
  CHECK(carillon_time_s(NULL) == 0 && carillon_horizon_s(NULL) == 0);
  carillon_destroy(synth);

  options.microphones_m = microphones;
  CHECK(carillon_create(&options, &other, NULL, 0) == CARILLON_BAD_ARGUMENT && other == NULL);
  options.microphone_count = 3;
  CHECK(carillon_create(&options, &other, NULL, 0) == CARILLON_OK);
  carillon_destroy(other);
  options.rate_hz = 0;
  CHECK(carillon_create(&options, &other, message, sizeof message) == CARILLON_BAD_INPUT && other == NULL && message[0] != '\0');
  options.size = 1;
  CHECK(carillon_create(&options, &other, NULL, 0) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_create(NULL, &other, NULL, 0) == CARILLON_BAD_ARGUMENT &&
        carillon_create(&options, NULL, NULL, 0) == CARILLON_BAD_ARGUMENT);
  carillon_destroy(NULL);
}

/* On a floor the pressure is twice that without one; programs that know of none have none. */
static void check_sensors(const carillon_bank* bank, const carillon_model* model) {
  static double samples[4096];
  const double place[3] = {0, 1, 0};
  carillon_options options;
  carillon_synth* synth;
  carillon_sensor sensor;
  carillon_impulse impulse;
  int32_t body, number, count, i;
  double largest = 0;
  carillon_options_init(&options);
  CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_OK);
  CHECK(carillon_add_body(synth, model, place, &body, message, sizeof message) == CARILLON_OK);
  carillon_sensor_init(&sensor);
  carillon_sensor_init(NULL);
  CHECK(sensor.quantity == CARILLON_ACCELERATION && sensor.rate_hz == 0 && sensor.buffer_s == 1 && sensor.direction[2] == 1);
  sensor.body = body;
  CHECK(carillon_add_sensor(synth, bank, &sensor, &number, message, sizeof message) == CARILLON_OK && number == 0);
  sensor.quantity = 4;
  CHECK(carillon_add_sensor(synth, bank, &sensor, &number, message, sizeof message) == CARILLON_BAD_INPUT && number == -1);
  sensor.quantity = CARILLON_STRAIN;
  sensor.rate_hz = 1e9;
  CHECK(carillon_add_sensor(synth, bank, &sensor, &number, message, sizeof message) == CARILLON_BAD_INPUT && message[0] != '\0');
  sensor.rate_hz = 0;
  sensor.body = 7;
  CHECK(carillon_add_sensor(synth, bank, &sensor, &number, NULL, 0) == CARILLON_BAD_INPUT);
  sensor.size = 0;
  CHECK(carillon_add_sensor(synth, bank, &sensor, &number, NULL, 0) == CARILLON_BAD_ARGUMENT);
  CHECK(carillon_add_sensor(NULL, NULL, NULL, NULL, NULL, 0) == CARILLON_BAD_ARGUMENT);
  carillon_impulse_init(&impulse);
  impulse.body = body;
  impulse.impulse_n_s[2] = 0.01;
  impulse.time_s = 0.002;
  CHECK(carillon_push_impulse(synth, &impulse) == CARILLON_OK);
  CHECK(carillon_read_sensor(synth, 0, samples, 4096) == 0);
  play(synth, 40);
  count = carillon_read_sensor(synth, 0, samples, 4096);
  CHECK(count > 2000 && carillon_sensor_begin_s(synth, 0) == 0 && carillon_sensor_lost(synth, 0) == 0);
  for (i = 0; i < count; ++i) largest = fabs(samples[i]) > largest ? fabs(samples[i]) : largest;
  CHECK(largest > 0 && samples[95] == 0 && samples[96] != 0); /* 0.002 s */
  CHECK(carillon_read_sensor(synth, 0, NULL, 10) == 0 && carillon_read_sensor(synth, 9, samples, 10) == 0);
  CHECK(carillon_read_sensor(NULL, 0, samples, 10) == 0 && carillon_sensor_lost(NULL, 0) == 0 && carillon_sensor_begin_s(NULL, 0) == 0);
  play(synth, 1200);
  CHECK(carillon_sensor_lost(synth, 0) > 0);
  CHECK(carillon_swap_model(synth, body, model, message, sizeof message) == CARILLON_BAD_INPUT);
  CHECK(carillon_remove_body(synth, body) == CARILLON_OK);
  play(synth, 2);
  carillon_collect(synth);
  CHECK(carillon_read_sensor(synth, 0, samples, 4096) > 0);
  play(synth, 2);
  carillon_destroy(synth);
}

static void check_floor(const carillon_model* model) {
  static float heard[128];
  static const double on_it[1][3] = {{0, 0, -0.5}};
  float* const out[1] = {heard};
  carillon_options options;
  carillon_body_options body_options;
  carillon_impulse impulse;
  carillon_synth* synth;
  int32_t body;
  int i, n, with;
  double squares[2] = {0, 0};
  for (with = 0; with < 2; ++with) {
    carillon_options_init(&options);
    CHECK(options.floor_reflection == 0);
    options.microphones_m = on_it;
    options.microphone_count = 1;
    options.floor_height_m = -0.5;
    options.floor_reflection = with;
    carillon_body_options_init(&body_options);
    CHECK((body_options.effects & CARILLON_GROUND_REFLECTION) == 0);
    if (with) body_options.effects |= CARILLON_GROUND_REFLECTION;
    body_options.position_m[1] = 2;
    CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_OK);
    CHECK(carillon_add_body_with(synth, model, &body_options, &body, message, sizeof message) == CARILLON_OK);
    carillon_impulse_init(&impulse);
    impulse.body = body;
    impulse.time_s = 0.01;
    impulse.impulse_n_s[2] = 1e-3;
    CHECK(carillon_push_impulse(synth, &impulse) == CARILLON_OK);
    for (i = 0; i < 40; ++i) {
      carillon_process(synth, out, 1, 128);
      for (n = 0; n < 128; ++n) squares[with] += (double)heard[n] * heard[n];
    }
    if (!with) {
      body_options.effects |= CARILLON_GROUND_REFLECTION;
      CHECK(carillon_add_body_with(synth, model, &body_options, &body, message, sizeof message) == CARILLON_BAD_INPUT &&
            strstr(message, "floor") != NULL);
    }
    carillon_destroy(synth);
  }
  CHECK(squares[0] > 0 && squares[1] > 3.99 * squares[0] && squares[1] < 4.01 * squares[0]);
  options.floor_reflection = -1;
  CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_BAD_INPUT && strstr(message, "reflection") != NULL);
  carillon_options_init_sized(&options, offsetof(carillon_options, floor_height_m));
  options.floor_reflection = -1; /* is not looked at */
  CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_OK);
  carillon_destroy(synth);
}

/* A body on the left is louder there by a head, and what programs know that were built before heads has none. */
static void check_head(const carillon_model* model) {
  static float left[128], right[128];
  static const double middle[1][3] = {{0, 0, 0}};
  float* const out[2] = {left, right};
  carillon_options options;
  carillon_body_options body_options;
  carillon_effect_counters effects;
  carillon_impulse impulse;
  carillon_synth* synth;
  int32_t body;
  int i, n;
  double loud = 0, soft = 0;
  carillon_options_init_sized(&options, offsetof(carillon_options, head_radius_m));
  options.head_radius_m = -1; /* is not looked at */
  CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_OK);
  carillon_body_options_init(&body_options);
  CHECK((body_options.effects & CARILLON_HEAD) == 0);
  body_options.effects |= CARILLON_HEAD;
  body_options.position_m[0] = -2;
  CHECK(carillon_add_body_with(synth, model, &body_options, &body, message, sizeof message) == CARILLON_BAD_INPUT && message[0] != '\0');
  carillon_destroy(synth);
  carillon_options_init(&options);
  CHECK(options.head_radius_m == 0);
  options.head_radius_m = 0.0875;
  CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_OK);
  CHECK(carillon_add_body_with(synth, model, &body_options, &body, message, sizeof message) == CARILLON_OK);
  carillon_impulse_init(&impulse);
  impulse.body = body;
  impulse.time_s = 0.01;
  impulse.impulse_n_s[2] = 1e-3;
  CHECK(carillon_push_impulse(synth, &impulse) == CARILLON_OK);
  for (i = 0; i < 40; ++i) {
    carillon_process(synth, out, 2, 128);
    for (n = 0; n < 128; ++n) {
      loud += (double)left[n] * left[n];
      soft += (double)right[n] * right[n];
    }
  }
  CHECK(loud > 1.2 * soft && soft > 0);
  carillon_effect_counters_init(&effects);
  CHECK(carillon_get_effect_counters(synth, body, &effects) == CARILLON_OK && effects.head_units > 1000);
  carillon_destroy(synth);
  options.head_radius_m = 5;
  CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_BAD_INPUT && strstr(message, "radius") != NULL);
  options.head_radius_m = 0.0875;
  options.microphones_m = middle;
  options.microphone_count = 1;
  CHECK(carillon_create(&options, &synth, message, sizeof message) == CARILLON_BAD_INPUT && strstr(message, "two microphones") != NULL);
}

int main(int argc, char** argv) {
  carillon_bank* bank = NULL;
  carillon_model* model = NULL;
  if (argc != 3) return 2;
  CHECK(carillon_abi_version() == CARILLON_ABI_VERSION);
  check_banks(argv[1], &bank);
  check_frequencies(argv[2]);
  check_nearest(bank);
  check_variation(bank);
  check_models(bank, &model);
  CHECK(strcmp(carillon_status_text(CARILLON_OK), "ok") == 0 && strlen(carillon_status_text(CARILLON_FULL)) > 3);
  CHECK(strlen(carillon_status_text((carillon_status)99)) > 3);
  check_edits(bank);
  check_bodies(bank, model);
  check_sensors(bank, model);
  carillon_bank_close(bank); /* the model stays */
  check_synth(model);
  check_forces(model);
  check_contacts(model);
  check_surfaces(model);
  check_head(model);
  check_floor(model);
  carillon_model_release(model);
  return failures == 0 ? 0 : 1;
}
