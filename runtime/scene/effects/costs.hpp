// The cost of a unit of each effect's work on this machine.
#pragma once

namespace carillon::effects {

/// Nanoseconds of CPU time. The initialisers were measured on an Intel Xeon (Emerald Rapids) with AVX-512; measure_costs() takes those of
/// the machine at hand.
struct Costs {
  double mode_sample_ns = 0.035;        // one mode, one sample
  double voice_sample_ns = 0.5;         // one awake body, one sample, without its modes
  double event_ns = 1000.0;             // one strike, or one event of a force, whatever the modes
  double strike_mode_ns = 1.5;          // one strike on one mode
  double pulse_mode_sample_ns = 0.5;    // one mode, one sample, while a pulse acts
  double pulse_mode_ns = 10.0;          // one pulse, one mode, in addition, however short
  double force_mode_ns = 12.0;          // the same for one event of a force that is known step by step
  double step_mode_ns = 0.4;            // and for one of its steps
  double ear_sample_ns = 6.0;           // one body at one microphone, one sample, standing still
  double moving_ear_sample_ns = 12.0;   // the same with a delay that changes
  double dipole_ear_sample_ns = 9.0;    // in addition, for the three histories of acceleration noise
  double click_sample_ns = 4.0;         // one body that clicks
  double force_sample_ns = 15.0;        // one lasting contact, one sample
  double transfer_ns = 80.0;            // directivity: one mode looked up for one microphone
  double head_sample_ns = 12.0;         // a head's two ears for one body, one sample, in a direction that stays
  double moving_head_sample_ns = 26.0;  // in one that changes
  double coupled_mode_ns = 4.0;         // nonlinear: one coupled mode, one sample; not measured again where the program runs
  double coupling_ns = 0.047;           // and one number of its matrices that is multiplied; likewise
  double cascade_mode_ns = 2.0;         // cascade: one mode above the coupled ones, one sample; likewise
};

/// Runs a made-up body for some milliseconds. [main-thread]
Costs measure_costs();

}  // namespace carillon::effects
