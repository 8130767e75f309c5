/* A body that slides over the ground for half a second, and is made smaller and lighter while it rings: contacts that last, edits without a
 * solve, and a budget, through the C interface. */
#include <carillon.h>
#include <stdio.h>

static int fail(const char* message) {
  fprintf(stderr, "slide_c: %s\n", message);
  return 1;
}

/* What a physics engine would say of a touch, a hundred times a second. */
static int slide(carillon_synth* synth, int32_t body, double time_s, int32_t state) {
  carillon_contact contact;
  carillon_contact_init(&contact);
  contact.id = 1;
  contact.body = body;
  contact.state = state;
  contact.time_s = time_s;
  contact.force_n = 3.0;
  contact.slip_m_s[0] = 0.4;
  contact.other_sweep_m_s = 0.4; /* the spot moves over the ground, not over the body */
  contact.patch_radius_m = 2e-4;
  return carillon_push_contact(synth, &contact) == CARILLON_OK && carillon_push_mark(synth, time_s) == CARILLON_OK;
}

static carillon_model* make_model(const carillon_bank* bank, char* message, size_t size) {
  carillon_model_options options;
  carillon_model* model = NULL;
  carillon_model_options_init(&options);
  (void)carillon_model_make(bank, &options, &model, message, size);
  return model;
}

int main(int argc, char** argv) {
  char message[512];
  carillon_bank *bank = NULL, *edited = NULL;
  carillon_model *model = NULL, *smaller = NULL;
  carillon_synth* synth = NULL;
  carillon_edits edits;
  carillon_options options;
  carillon_body_options body_options;
  carillon_impulse impulse;
  carillon_counters counters;
  float left[480], right[480];
  float* out[2];
  float before = 0.0f, after = 0.0f;
  int32_t body = -1;
  int block, n;

  if (argc != 2) return fail("usage: slide_c BANK");
  if (carillon_bank_open(argv[1], &bank, message, sizeof message) != CARILLON_OK) return fail(message);
  carillon_edits_init(&edits);
  edits.size_scale = 0.8;
  edits.density_scale = 0.5;
  if (carillon_bank_edit(bank, &edits, &edited, message, sizeof message) != CARILLON_OK) return fail(message);
  model = make_model(bank, message, sizeof message);
  if (model != NULL) smaller = make_model(edited, message, sizeof message);
  if (smaller == NULL) return fail(message);

  carillon_options_init(&options);
  options.budget = 500 * options.rate_hz; /* at most 500 modes at a time */
  if (carillon_create(&options, &synth, message, sizeof message) != CARILLON_OK) return fail(message);
  carillon_body_options_init(&body_options);
  body_options.position_m[1] = 1.0;
  if (carillon_add_body_with(synth, model, &body_options, &body, message, sizeof message) != CARILLON_OK) return fail(message);

  carillon_impulse_init(&impulse);
  impulse.body = body;
  impulse.time_s = 0.01;
  impulse.duration_s = 1e-4;
  impulse.impulse_n_s[2] = 0.01;
  if (carillon_push_impulse(synth, &impulse) != CARILLON_OK) return fail("the blow cannot be played");
  if (!slide(synth, body, 0.02, CARILLON_CONTACT_BEGIN)) return fail("the contact cannot be played");

  out[0] = left;
  out[1] = right;
  for (block = 0; block < 100; ++block) { /* one second, 10 ms a block */
    const double ahead_s = 0.01 * (block + 3);
    if (ahead_s < 0.5 && !slide(synth, body, ahead_s, CARILLON_CONTACT_HOLD)) return fail("the contact cannot be played");
    if (block == 48 && !slide(synth, body, 0.51, CARILLON_CONTACT_END)) return fail("the contact cannot be played");
    if (block >= 48) (void)carillon_push_mark(synth, ahead_s); /* nothing more happens */
    if (block == 50) {                                         /* the slider of a game */
      if (carillon_swap_model(synth, body, smaller, message, sizeof message) != CARILLON_OK) return fail(message);
    }
    carillon_process(synth, out, 2, 480); /* as an audio callback would */
    for (n = 0; n < 480; ++n) {
      const float pressure = left[n] < 0 ? -left[n] : left[n];
      float* peak = block < 50 ? &before : &after;
      if (pressure > *peak) *peak = pressure;
    }
    if (block % 10 == 0) carillon_collect(synth); /* the old model's memory */
  }
  carillon_counters_init(&counters);
  if (carillon_get_counters(synth, &counters) != CARILLON_OK) return fail("no counters");
  printf("peak %g Pa, %g Pa after the edit; %.0f -> %.0f Hz; %ld underruns\n", (double)before, (double)after,
         carillon_bank_frequency_hz(bank, 0), carillon_bank_frequency_hz(edited, 0), (long)counters.underruns);

  carillon_destroy(synth);
  carillon_model_release(smaller);
  carillon_model_release(model);
  carillon_bank_close(edited);
  carillon_bank_close(bank);
  return before > 0.0f && after > 0.0f && counters.underruns == 0 ? 0 : 1;
}
