// Synthesiser, contact tracker and output of the examples with physics engines. C++14.
#pragma once

#include <carillon.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <vector>

#include "message.hpp"

class Sound {
 public:
  /// The listener is at (0, -1, 0.2) m.
  explicit Sound(const carillon_touches_options& touches_options) {
    carillon_options options;
    carillon_options_init(&options);
    options.listener_m[1] = -1.0;
    options.listener_m[2] = 0.2;
    message_.check(carillon_create(&options, &synth_, message_.text(), message_.size()));
    message_.check(carillon_touches_create(synth_, &touches_options, &touches_, message_.text(), message_.size()));
  }
  ~Sound() {
    carillon_touches_destroy(touches_);
    carillon_destroy(synth_);
    for (carillon_bank* bank : banks_) carillon_bank_close(bank);
  }
  Sound(const Sound&) = delete;
  Sound& operator=(const Sound&) = delete;

  /// Adds a body with all of the default effects, and those of lasting contacts. Its index in the tracker.
  std::int32_t add(const char* bank_file, const char* name, double restitution, double friction) {
    carillon_bank* bank = nullptr;
    carillon_model* model = nullptr;
    message_.check(carillon_bank_open(bank_file, &bank, message_.text(), message_.size()));
    banks_.push_back(bank);
    carillon_model_options model_options;
    carillon_model_options_init(&model_options);
    message_.check(carillon_model_make(bank, &model_options, &model, message_.text(), message_.size()));
    carillon_body_options options;
    carillon_body_options_init(&options);
    options.effects |= CARILLON_ROUGHNESS | CARILLON_ROLLING | CARILLON_CONTACT_DAMPING;
    options.friction = friction;
    carillon_touches_body body;
    carillon_touches_body_init(&body);
    message_.check(carillon_add_body_with(synth_, model, &options, &body.body, message_.text(), message_.size()));
    carillon_model_release(model);  // the body keeps it
    body.bank = bank;
    body.name_seed = carillon_name_seed(name);
    body.restitution = restitution;
    body.friction = friction;
    std::int32_t index = -1;
    message_.check(carillon_touches_add(touches_, &body, &index, message_.text(), message_.size()));
    return index;
  }
  const carillon_bank* get_bank(std::int32_t index) const { return banks_[static_cast<std::size_t>(index)]; }
  carillon_touches* get_touches() const { return touches_; }

  /// Plays up to where the physics is known, as an audio callback would.
  void play() {
    while (carillon_time_s(synth_) + 256 / 48000.0 < carillon_touches_mark_s(touches_)) {
      float left[128], right[128];
      float* const ears[] = {left, right};
      carillon_process(synth_, ears, 2, 128);
      for (int n = 0; n < 128; ++n) heard_.insert(heard_.end(), {left[n], right[n]});
    }
  }
  /// Writes pairs of floats at 48 kHz [Pa], and prints the counters.
  void finish(const char* file) {
    std::ofstream out(file, std::ios::binary);
    out.write(reinterpret_cast<const char*>(heard_.data()), static_cast<std::streamsize>(heard_.size() * sizeof(float)));
    if (!out.flush()) std::fprintf(stderr, "%s: cannot be written\n", file), std::exit(1);
    carillon_touches_counters seen;
    carillon_touches_counters_init(&seen);
    message_.check(carillon_touches_get_counters(touches_, &seen));
    carillon_counters counters;
    carillon_counters_init(&counters);
    message_.check(carillon_get_counters(synth_, &counters));
    const std::int64_t lost = counters.refused + counters.late + counters.faults + counters.overflows + counters.resets;
    std::printf("%lld hits, %lld lasting contacts, %zu frames, %lld events lost\n", static_cast<long long>(seen.hits),
                static_cast<long long>(seen.touches), heard_.size() / 2, static_cast<long long>(lost));
  }

 private:
  Message message_;
  carillon_synth* synth_ = nullptr;
  carillon_touches* touches_ = nullptr;
  std::vector<carillon_bank*> banks_;
  std::vector<float> heard_;
};
