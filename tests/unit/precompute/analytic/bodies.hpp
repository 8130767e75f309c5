// Jobs and sums for the tests of bodies with known modes.
#pragma once

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "precompute/analytic/known_body.hpp"
#include "precompute/job/job_spec.hpp"

namespace carillon::analytic {

inline job::JobSpec parse(const std::string& body, const std::string& material = R"("steel")", const std::string& more = "") {
  return job::parse_job(R"({"body": )" + body + R"(, "material": )" + material + R"(, "bank": "b.hdf")" + more + "}", "/tmp/job.json");
}

/// With arbitrary damping.
inline std::string make_material(double young_pa, double poisson_ratio, double density_kg_m3) {
  return R"({"young_modulus_pa": )" + std::to_string(young_pa) + R"(, "poisson_ratio": )" + std::to_string(poisson_ratio) +
         R"(, "density_kg_m3": )" + std::to_string(density_kg_m3) + R"(, "damping": {"internal_friction": {"tan_phi": 0.001}}})";
}

inline std::unique_ptr<KnownBody> make(const job::JobSpec& job) { return make_known_body(*job.analytic, job.material); }

inline double to_hz(const Mode& mode) { return std::sqrt(mode.lambda_rad2_s2) / (2.0 * std::numbers::pi); }

inline constexpr std::int64_t kAll = 1 << 30;

}  // namespace carillon::analytic
