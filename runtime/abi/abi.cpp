// Method:     opaque handles around the C++ classes; exceptions end here and become a status and a message.
// Source:     none.
// Deviations: none.
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
#include <span>
#include <string_view>

#include "runtime/abi/carillon.h"
#include "runtime/bank/bank.hpp"
#include "runtime/config/error.hpp"
#include "runtime/radiation/gains.hpp"
#include "runtime/stream/events.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/synthesiser.hpp"

struct carillon_bank {
  carillon::bank::Bank bank;
};
struct carillon_model {
  std::shared_ptr<const carillon::synth::Model> model;
};
struct carillon_synth {
  carillon::synth::Synthesiser synthesiser;
};

namespace {

using namespace carillon;

void write_message(std::string_view text, char* message, size_t message_size) {
  if (message == nullptr || message_size == 0) return;
  const std::size_t length = std::min(text.size(), message_size - 1);
  std::memcpy(message, text.data(), length);
  message[length] = '\0';
}

/// Runs `work` and makes a status of what it throws.
template <typename Work>
carillon_status run(char* message, size_t message_size, Work&& work) noexcept {
  try {
    work();
    write_message("", message, message_size);
    return CARILLON_OK;
  } catch (const InputError& error) {
    write_message(error.what(), message, message_size);
    return CARILLON_BAD_INPUT;
  } catch (const std::bad_alloc&) {
    write_message("out of memory", message, message_size);
  } catch (const std::exception& error) {
    write_message(error.what(), message, message_size);
  } catch (...) {
    write_message("unknown error", message, message_size);
  }
  return CARILLON_SYSTEM;
}

carillon_status refuse(const char* text, char* message, size_t message_size) {
  write_message(text, message, message_size);
  return CARILLON_BAD_ARGUMENT;
}

/// Whether a structure of the caller is there and as large as ours: there has been but one version so far.
template <typename T>
bool is_whole(const T* given) {
  return given != nullptr && given->size >= sizeof(T);
}

template <typename T>
void init(T* given) {
  if (given == nullptr) return;
  *given = T{};
  given->size = sizeof(T);
}

stream::Vec3 to_vector(const double* x) { return {x[0], x[1], x[2]}; }

carillon_status push(carillon_synth* synth, const stream::Event& event) noexcept {
  if (stream::find_fault(event) != nullptr) {
    (void)synth->synthesiser.push(event);  // counts it
    return CARILLON_BAD_INPUT;
  }
  return synth->synthesiser.push(event) ? CARILLON_OK : CARILLON_FULL;
}

}  // namespace

extern "C" {

uint32_t carillon_abi_version(void) { return CARILLON_ABI_VERSION; }

carillon_status carillon_bank_open(const char* file, carillon_bank** bank, char* message, size_t message_size) {
  if (bank != nullptr) *bank = nullptr;
  if (file == nullptr || bank == nullptr) return refuse("carillon_bank_open: file and bank must not be NULL", message, message_size);
  return run(message, message_size, [&] { *bank = new carillon_bank{bank::read_bank(file)}; });
}

carillon_status carillon_bank_parse(const void* bytes, size_t size, carillon_bank** bank, char* message, size_t message_size) {
  if (bank != nullptr) *bank = nullptr;
  if (bytes == nullptr || bank == nullptr) return refuse("carillon_bank_parse: bytes and bank must not be NULL", message, message_size);
  return run(message, message_size, [&] { *bank = new carillon_bank{bank::parse_bank({static_cast<const std::byte*>(bytes), size})}; });
}

void carillon_bank_close(carillon_bank* bank) { delete bank; }

int32_t carillon_bank_mode_count(const carillon_bank* bank) { return bank == nullptr ? 0 : static_cast<int32_t>(bank->bank.mode_count()); }

int32_t carillon_bank_triangle_count(const carillon_bank* bank) {
  return bank == nullptr ? 0 : static_cast<int32_t>(bank->bank.triangles.size());
}

double carillon_bank_frequency_hz(const carillon_bank* bank, int32_t mode) {
  return mode < 0 || mode >= carillon_bank_mode_count(bank) ? 0.0 : bank->bank.freq_hz(static_cast<std::size_t>(mode));
}

void carillon_model_options_init(carillon_model_options* options) {
  init(options);
  if (options != nullptr) options->rate_hz = 48000.0;
}

carillon_status carillon_model_make(const carillon_bank* bank, const carillon_model_options* options, carillon_model** model, char* message,
                                    size_t message_size) {
  if (model != nullptr) *model = nullptr;
  if (bank == nullptr || model == nullptr || !is_whole(options))
    return refuse("carillon_model_make: bank and model must not be NULL, options must be initialised", message, message_size);
  if (options->radiation != CARILLON_RADIATION_SPHERE && options->radiation != CARILLON_RADIATION_OSG02)
    return refuse("carillon_model_make: options.radiation is none of carillon_radiation", message, message_size);
  return run(message, message_size, [&] {
    const auto kind = options->radiation == CARILLON_RADIATION_SPHERE ? radiation::GainKind::kSphere : radiation::GainKind::kOsg02;
    const std::vector<double> gains = radiation::calc_gains(bank->bank, kind);
    *model = new carillon_model{synth::Model::make(bank->bank, {.rate_hz = options->rate_hz, .gains = gains})};
  });
}

void carillon_model_release(carillon_model* model) { delete model; }

int32_t carillon_model_mode_count(const carillon_model* model) { return model == nullptr ? 0 : model->model->get_mode_count(); }

void carillon_options_init(carillon_options* options) {
  init(options);
  if (options == nullptr) return;
  const synth::SynthesiserOptions ours;
  options->rate_hz = ours.rate_hz;
  options->max_bodies = ours.max_bodies;
  options->max_strikes = ours.max_strikes;
  options->ring_events = ours.ring_events;
  options->longest_m = ours.longest_m;
}

carillon_status carillon_create(const carillon_options* options, carillon_synth** synth, char* message, size_t message_size) {
  if (synth != nullptr) *synth = nullptr;
  if (synth == nullptr || !is_whole(options))
    return refuse("carillon_create: synth must not be NULL, options must be initialised", message, message_size);
  if (options->microphones_m != nullptr && options->microphone_count < 1)
    return refuse("carillon_create: microphone_count must be positive where microphones are given", message, message_size);
  return run(message, message_size, [&] {
    synth::SynthesiserOptions ours{.rate_hz = options->rate_hz,
                                   .listener_m = to_vector(options->listener_m),
                                   .max_bodies = options->max_bodies,
                                   .max_strikes = options->max_strikes,
                                   .ring_events = options->ring_events,
                                   .longest_m = options->longest_m};
    if (options->microphones_m != nullptr) {
      ours.microphones_m.clear();
      for (int32_t m = 0; m < options->microphone_count; ++m) ours.microphones_m.push_back(to_vector(options->microphones_m[m]));
    }
    *synth = new carillon_synth{synth::Synthesiser(std::move(ours))};
  });
}

void carillon_destroy(carillon_synth* synth) { delete synth; }

carillon_status carillon_add_body(carillon_synth* synth, const carillon_model* model, const double position_m[3], int32_t* body,
                                  char* message, size_t message_size) {
  if (body != nullptr) *body = -1;
  if (synth == nullptr || model == nullptr || position_m == nullptr || body == nullptr)
    return refuse("carillon_add_body: synth, model, position_m and body must not be NULL", message, message_size);
  if (synth->synthesiser.is_full()) {
    write_message("there is no room for another body; raise max_bodies, or remove one", message, message_size);
    return CARILLON_FULL;
  }
  return run(message, message_size, [&] { *body = synth->synthesiser.add_body(model->model, {.position_m = to_vector(position_m)}); });
}

carillon_status carillon_remove_body(carillon_synth* synth, int32_t body) {
  if (synth == nullptr) return CARILLON_BAD_ARGUMENT;
  return run(nullptr, 0, [&] { synth->synthesiser.remove_body(body); });
}

void carillon_collect(carillon_synth* synth) {
  if (synth != nullptr) synth->synthesiser.collect();
}

void carillon_set_gain(carillon_synth* synth, double per_pa) {
  if (synth != nullptr) synth->synthesiser.set_gain(per_pa);
}

void carillon_impulse_init(carillon_impulse* impulse) {
  init(impulse);
  if (impulse != nullptr) impulse->barycentric[0] = 1.0;
}
void carillon_motion_init(carillon_motion* motion) { init(motion); }
void carillon_listener_init(carillon_listener* listener) { init(listener); }

carillon_status carillon_push_impulse(carillon_synth* synth, const carillon_impulse* impulse) {
  if (synth == nullptr || !is_whole(impulse)) return CARILLON_BAD_ARGUMENT;
  return push(synth, stream::Impulse{.time_s = impulse->time_s,
                                     .body = impulse->body,
                                     .triangle = impulse->triangle,
                                     .shape = impulse->gaussian != 0 ? stream::PulseShape::kGaussian : stream::PulseShape::kHertz,
                                     .barycentric = to_vector(impulse->barycentric),
                                     .impulse_n_s = to_vector(impulse->impulse_n_s),
                                     .duration_s = impulse->duration_s});
}

carillon_status carillon_push_motion(carillon_synth* synth, const carillon_motion* motion) {
  if (synth == nullptr || !is_whole(motion)) return CARILLON_BAD_ARGUMENT;
  return push(synth, stream::Motion{.time_s = motion->time_s,
                                    .body = motion->body,
                                    .position_m = to_vector(motion->position_m),
                                    .velocity_m_s = to_vector(motion->velocity_m_s)});
}

carillon_status carillon_push_listener(carillon_synth* synth, const carillon_listener* listener) {
  if (synth == nullptr || !is_whole(listener)) return CARILLON_BAD_ARGUMENT;
  return push(synth, stream::Listener{.time_s = listener->time_s,
                                      .position_m = to_vector(listener->position_m),
                                      .velocity_m_s = to_vector(listener->velocity_m_s)});
}

void carillon_process(carillon_synth* synth, float* const* out, int32_t channels, int32_t frames) {
  if (synth == nullptr || out == nullptr || channels <= 0 || frames <= 0) return;
  synth->synthesiser.process(out, channels, frames);
}

double carillon_time_s(const carillon_synth* synth) { return synth == nullptr ? 0.0 : synth->synthesiser.get_time_s(); }
double carillon_horizon_s(const carillon_synth* synth) { return synth == nullptr ? 0.0 : synth->synthesiser.get_horizon_s(); }

carillon_status carillon_get_counters(const carillon_synth* synth, carillon_counters* counters) {
  if (synth == nullptr || !is_whole(counters)) return CARILLON_BAD_ARGUMENT;
  const synth::SynthesiserCounters ours = synth->synthesiser.get_counters();
  counters->strikes = ours.strikes;
  counters->refused = ours.refused;
  counters->late = ours.late;
  counters->faults = ours.faults;
  counters->overflows = ours.overflows;
  counters->resets = ours.resets;
  counters->mode_samples = ours.mode_samples;
  return CARILLON_OK;
}

}  // extern "C"
