/* A bank that is struck once, played block by block through the C interface. */
#include <carillon.h>
#include <stdio.h>

static int fail(const char* message) {
  fprintf(stderr, "strike_c: %s\n", message);
  return 1;
}

int main(int argc, char** argv) {
  char message[512];
  carillon_bank* bank = NULL;
  carillon_model* model = NULL;
  carillon_synth* synth = NULL;
  carillon_model_options model_options;
  carillon_options options;
  carillon_impulse impulse;
  const double place_m[3] = {0.0, 2.0, 0.0};
  float left[128], right[128];
  float* out[2];
  float peak = 0.0f;
  int32_t body = -1;
  int block, n;

  if (argc != 2) return fail("usage: strike_c BANK");
  if (carillon_bank_open(argv[1], &bank, message, sizeof message) != CARILLON_OK) return fail(message);
  carillon_model_options_init(&model_options);
  if (carillon_model_make(bank, &model_options, &model, message, sizeof message) != CARILLON_OK) return fail(message);
  carillon_options_init(&options);
  if (carillon_create(&options, &synth, message, sizeof message) != CARILLON_OK) return fail(message);
  if (carillon_add_body(synth, model, place_m, &body, message, sizeof message) != CARILLON_OK) return fail(message);

  carillon_impulse_init(&impulse);
  impulse.body = body;
  impulse.time_s = 0.01;
  impulse.duration_s = 1e-4;
  impulse.impulse_n_s[2] = 0.01;
  if (carillon_push_impulse(synth, &impulse) != CARILLON_OK) return fail("the blow cannot be played");

  out[0] = left;
  out[1] = right;
  for (block = 0; block < 375; ++block) { /* one second */
    carillon_process(synth, out, 2, 128); /* as an audio callback would */
    for (n = 0; n < 128; ++n) {
      const float pressure = left[n] < 0 ? -left[n] : left[n];
      if (pressure > peak) peak = pressure;
    }
  }
  printf("%d modes, peak %g Pa at the left ear\n", (int)carillon_model_mode_count(model), (double)peak);

  carillon_destroy(synth);
  carillon_model_release(model);
  carillon_bank_close(bank);
  return peak > 0.0f ? 0 : 1;
}
