// Banks of bodies with known modes.
#pragma once

#include "precompute/job/job_spec.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::analytic {

struct Made {
  bank::Bank bank;  // provenance is empty
  std::string theory, method;
  std::vector<std::string> names;     // (m) mode names: "(1, 2)"
  std::vector<std::string> warnings;  // limits of the theory for this body
  std::string coupling;               // description of the coupling; empty: none
};

/// Bank of job.analytic: modes of its band, shapes on its surface, gains and decays. Throws InputError, SolveError.
Made make_bank(const job::JobSpec& job);

/// One mode at one point, unrounded.
struct ModeAtPoint {
  double freq_hz = 0.0;
  Vec3 phi{};  // [kg^-1/2]
  std::string name;
};

/// Modes of the band at a point of the body, before rounding to the bank's steps.
std::vector<ModeAtPoint> calc_modes_at(const job::JobSpec& job, const Vec3& point_m);

}  // namespace carillon::analytic
