#include <array>
#include <cmath>
#include <utility>

#include "precompute/job/cost/memory.hpp"
#include "precompute/job/cost/seconds.hpp"
#include "precompute/run/validate.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/json.hpp"

namespace carillon::run {
namespace {

cost::ProblemSize parse_size(const std::string& text) {
  base::Object root = base::parse_document(text, "--estimate").root();
  const bool is_quadratic = root.choice_or("element", {"T4", "T10"}, "T10") == "T10";
  cost::ProblemSize size = cost::estimate_meshed_size(root.integer("nodes", 4, 1LL << 40), is_quadratic);
  size.modes = root.integer_if("modes", 0, 1LL << 24);
  root.finish();
  return cost::complete(size);
}

base::Json describe_seconds(const cost::PhaseSeconds& seconds) {
  using Phases = cost::PhaseSeconds;
  constexpr std::array<std::pair<const char*, double Phases::*>, 11> kNames{{{"read", &Phases::read},
                                                                             {"partition", &Phases::partition},
                                                                             {"assemble", &Phases::assemble},
                                                                             {"analyse", &Phases::analyse},
                                                                             {"factor", &Phases::factor},
                                                                             {"solve", &Phases::solve},
                                                                             {"orthogonalise", &Phases::orthogonalise},
                                                                             {"check", &Phases::check},
                                                                             {"errors", &Phases::errors},
                                                                             {"collect", &Phases::collect},
                                                                             {"write", &Phases::write}}};
  base::Json object = base::Json::object();
  for (const auto& [name, phase] : kNames) object.set(name, base::significant(seconds.*phase, 6));
  return object;
}

}  // namespace

std::string predict_cost(const std::string& text) {
  const cost::ProblemSize size = parse_size(text);
  const cost::PhaseSeconds seconds = cost::predict_seconds(size);
  base::Json root = base::Json::object();
  root.set("unknowns", size.unknowns).set("modes", *size.modes);
  root.set("cpu_seconds", base::significant(seconds.sum(), 6)).set("phase_seconds", describe_seconds(seconds));
  for (const int ranks : {1, 2, 4}) root["memory_bytes"].set(std::to_string(ranks), std::llround(cost::predict_bytes(size, ranks)));
  root["factor"].set("entries", size.factor_entries).set("flops", base::significant(size.factor_flops, 6));
  root.set("factorisations", cost::predict_factorisations(*size.modes, size.counts_low_end))
      .set("right_sides", cost::predict_solves(*size.modes));
  return root.line();
}

}  // namespace carillon::run
