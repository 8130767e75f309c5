// State of one simulation: bodies, motion, contacts and sound.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/job/simulation.hpp"
#include "precompute/simulation/bodies.hpp"
#include "precompute/simulation/checkpoint.hpp"
#include "precompute/simulation/emission/emission.hpp"
#include "precompute/simulation/motion_file.hpp"
#include "precompute/simulation/transient/contact.hpp"
#include "precompute/simulation/transient/domain.hpp"
#include "precompute/simulation/transient/motion.hpp"

namespace carillon::simulation {

/// Simulation state on this rank.
struct Simulation {
  job::SimulationSpec spec;
  std::string job_sha256;  // of the bytes of the job
  Bodies bodies;
  std::unique_ptr<transient::Domain> domain;
  std::unique_ptr<transient::Motion> motion;
  std::unique_ptr<transient::Contacts> contacts;
  std::unique_ptr<emission::Emission> sound;
  std::unique_ptr<MotionFile> film;
  std::vector<transient::EnergyBook> books;
  int steps_per_sample = 0;     // of the sound
  std::int64_t first_step = 0;  // of this process; after resumption, of the checkpoint
  double sound_cpu_s = 0, steps_cpu_s = 0, clock_s = 0;

  bool makes_sound() const { return !spec.sound.empty() || !spec.spectrogram.empty() || !spec.surface.empty(); }
};

/// Domain, motion and contacts of the spec and its bodies, with the first forces. Collective. Throws InputError on every rank, with the job
/// line, for an initial overlap.
void make_motion(const comm::Communicator& comm, Simulation& simulation);

/// Passes the ball centres to the sound, for visibility.
void set_balls(Simulation& simulation);

/// For a checkpoint. Collective.
SimulationState collect_state(const comm::Communicator& comm, Simulation& simulation);
void resume(const comm::Communicator& comm, const SimulationState& state, Simulation& simulation);

}  // namespace carillon::simulation
