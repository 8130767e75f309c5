// The bank of a body whose modes are known.
#pragma once

#include "precompute/job/job_spec.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::analytic {

struct Made {
  bank::Bank bank;  // without its provenance
  std::string theory, method;
  std::vector<std::string> names;     // (m) of the modes: "(1, 2)"
  std::vector<std::string> warnings;  // where the theory does not describe the body
  std::string coupling;               // what large motion couples; empty: nothing
};

/// The bank of job.analytic: the modes of its band, their shapes on its surface, gains and decays. Throws InputError, SolveError.
Made make_bank(const job::JobSpec& job);

/// One mode at one point, to all digits of the theory.
struct ModeAtPoint {
  double freq_hz = 0.0;
  Vec3 phi{};  // [kg^-1/2]
  std::string name;
};

/// The modes of the band at a point of the body; what make_bank() rounds to the bank's steps.
std::vector<ModeAtPoint> calc_modes_at(const job::JobSpec& job, const Vec3& point_m);

}  // namespace carillon::analytic
