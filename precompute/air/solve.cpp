// Method:     one wave number at a time: matrix in single precision, GMRES for the modes that read it, multipoles; LU where GMRES fails.
//   Modes are interpolated over the wave number; where three-point and four-point interpolation differ by more than the tolerance, a wave
//   number is inserted. Modes coupled by the air are sums of solutions at the wave number of the sum: partners are found from the modes'
//   own wave numbers, then solved at the mode's wave number in air, iterated until it settles.
// Source:     docs/equations.md E10.
#include "precompute/air/solve.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <utility>

#include "precompute/air/equations.hpp"
#include "precompute/air/expansion.hpp"
#include "precompute/air/gmres.hpp"
#include "precompute/air/wave_numbers.hpp"
#include "runtime/base/error.hpp"

namespace carillon::air {
namespace {

using Single = std::complex<float>;
using Double = std::complex<double>;

constexpr double kDirectResidual = 1e-3;  // relative residual of LU in single precision
constexpr int kRounds = 40;               // refinements of the wave numbers
constexpr int kSteps = 20;                // iterations of shifted or coupled modes
constexpr std::int32_t kMostOrder = 110;

/// Ranks that share wave numbers; each rank owns some of the rows.
class Group {
 public:
  Group(const comm::Communicator& comm, std::size_t unknowns, double matrix_bytes, std::size_t wave_numbers)
      : fits_one_rank_(8.0 * static_cast<double>(unknowns) * static_cast<double>(unknowns) <= matrix_bytes) {
    const double bytes = 8.0 * static_cast<double>(unknowns) * static_cast<double>(unknowns);
    const auto by_memory = static_cast<int>(std::min(1e6, std::ceil(bytes / matrix_bytes)));
    const int by_number = comm.size() / static_cast<int>(std::clamp<std::size_t>(wave_numbers, 1, 1000000));
    const int size = std::clamp(std::max(by_memory, by_number), 1, comm.size());
    count_ = comm.size() / size;
    number_ = std::min(comm.rank() / size, count_ - 1);
    MPI_Comm_split(comm, number_, comm.rank(), &owned_);
    comm_.emplace(owned_);
    const std::size_t blocks = (unknowns + kBlockRows - 1) / kBlockRows;
    for (int r = 0; r <= comm_->size(); ++r)
      first_.push_back(std::min(unknowns, blocks * static_cast<std::size_t>(r) / static_cast<std::size_t>(comm_->size()) * kBlockRows));
  }
  ~Group() { MPI_Comm_free(&owned_); }
  Group(const Group&) = delete;
  Group& operator=(const Group&) = delete;

  int get_number() const { return number_; }
  int count() const { return count_; }
  bool is_first() const { return comm_->is_root(); }
  bool has_all_rows() const { return comm_->size() == 1; }
  /// True if each rank may hold the whole matrix.
  bool fits_one_rank() const { return fits_one_rank_; }
  std::size_t get_first() const { return first_[comm_->rank()]; }
  std::size_t get_last() const { return first_[comm_->rank() + 1]; }

  /// Gathers all rows from the ranks.
  void gather(const Sides& mine, Sides& all) const { all.values = comm_->all_gather(mine.values); }

 private:
  MPI_Comm owned_ = MPI_COMM_NULL;
  std::optional<comm::Communicator> comm_;
  bool fits_one_rank_;
  int number_ = 0, count_ = 1;
  std::vector<std::size_t> first_;  // first row of each rank, and the end
};

/// Surface integral of p v, per side.
std::vector<Double> calc_reactions(const BoundaryEquations& equations, const std::vector<Single>& pressure,
                                   std::span<const std::int32_t> sides) {
  std::vector<Double> reactions(sides.size());
  const std::span<const float> velocity = equations.get_velocity();
  const std::size_t count = equations.count_velocities();
  const std::vector<Facet>& facets = equations.get_surface().get_facets();
  for (std::size_t t = 0; t < facets.size(); ++t)
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) {
        const double mass = facets[t].area_m2 / (i == j ? 6.0 : 12.0);
        const Single* p = &pressure[static_cast<std::size_t>(facets[t].corners[i]) * sides.size()];
        for (std::size_t m = 0; m < sides.size(); ++m)
          reactions[m] += mass * static_cast<double>(velocity[(t * 3 + j) * count + static_cast<std::size_t>(sides[m])]) * Double(p[m]);
      }
  return reactions;
}

WaveAnswer solve_wave(const BoundaryEquations& equations, const Group& group, double k, std::int32_t order,
                      const std::vector<std::int32_t>& sides, double tolerance, bool has_rows) {
  WaveAnswer answer{.k = k, .modes = {}, .products = 0, .residual = 0.0};
  const std::size_t unknowns = equations.get_surface().count_nodes();
  LinearSystem system;
  equations.assemble(k, sides, group.get_first(), group.get_last(), system);
  Sides mine(system.count_rows(), sides.size()), right(unknowns, sides.size()), pressures(unknowns, sides.size());
  const BlockInverse inverse(system);
  Sides own_right(system.right, system.count_rows(), sides.size());
  inverse.apply(own_right);
  group.gather(own_right, right);
  const Multiply multiply = [&](const Sides& x, Sides& y) {
    system.multiply(x, mine);
    inverse.apply(mine);
    group.gather(mine, y);
  };
  GmresResult result = solve_gmres(multiply, right, {.tolerance = tolerance}, pressures);
  if (!result.is_converged && (group.has_all_rows() || group.fits_one_rank())) {
    if (!group.has_all_rows()) equations.assemble(k, sides, 0, unknowns, system);  // every rank of the group assembles all rows
    result.residual = solve_directly(system, pressures);
    result.is_converged = result.residual <= kDirectResidual;
  }
  answer.products = result.products;
  answer.residual = result.residual;
  if (!result.is_converged)
    throw SolveError(
        fmt::format("the pressure on the surface does not converge at k = {:.6g} 1/m: residual {:.1e} after {} products of GMRES, asked "
                    "{:.0e}; possible causes: a surface mesh too coarse for the wavelength (\"skin_nodes\"), slivers or folds: remesh the "
                    "surface, or omit the air with "
                    "\"radiation\": \"none\"",
                    k, result.residual, result.products, tolerance));
  if (!group.is_first()) return answer;
  const Sphere& sphere = equations.get_sphere();
  const std::vector<Single> pressure = pressures.list();
  const std::vector<Double> expansion =
      calc_expansion(equations.get_surface(), sphere, k, order, pressure, equations.get_velocity(), equations.count_velocities(), sides);
  const std::vector<Double> reactions = calc_reactions(equations, pressure, sides);
  const std::size_t motions = equations.count_velocities();
  const std::vector<Double> rows = has_rows ? calc_reaction_rows(equations, pressure, sides.size()) : std::vector<Double>{};
  const std::vector<double> hankel = calc_log_hankel(k * sphere.radius_m, order);
  const std::size_t harmonics = count_harmonics(order);
  for (std::size_t m = 0; m < sides.size(); ++m) {
    Answer& mode = answer.modes[sides[m]];
    mode.order = order;
    mode.reaction = reactions[m];
    if (has_rows)
      for (std::size_t i = 0; i < motions; ++i) mode.row.emplace_back(rows[m * motions + i]);
    mode.coefficient.resize(harmonics);
    for (int l = 0; l <= order; ++l) {
      const double size = std::exp(hankel[l]);
      for (std::size_t i = count_harmonics(l - 1); i < count_harmonics(l); ++i)
        mode.coefficient[i] = Single(expansion[m * harmonics + i] * size);
    }
  }
  return answer;
}

// ---- interpolation ----

Sounding interpolate(const std::vector<const Answer*>& answers, const Stencil& stencil, const Spread& spread) {
  Sounding sounding;
  for (const Answer* answer : answers) sounding.order = std::max(sounding.order, answer->order);
  const std::size_t harmonics = count_harmonics(sounding.order);
  sounding.coefficient.resize(harmonics);
  double sum_near = 0.0, sum_far = 0.0, error_near = 0.0, error_far = 0.0;
  for (std::int32_t l = 0; l <= sounding.order; ++l) {
    const double near = spread.near[l], far = spread.far[l];
    for (std::size_t i = count_harmonics(l - 1); i < count_harmonics(l); ++i) {
      Double fine{}, coarse{};
      for (std::size_t n = 0; n < answers.size(); ++n) {
        if (i >= answers[n]->coefficient.size()) continue;
        const Double value(answers[n]->coefficient[i]);
        fine += stencil.weights[n] * value;
        coarse += stencil.weights_without_farthest[n] * value;
      }
      sounding.coefficient[i] = fine;
      sum_near += near * std::norm(fine);
      sum_far += far * std::norm(fine);
      error_near += near * std::norm(fine - coarse);
      error_far += far * std::norm(fine - coarse);
    }
  }
  for (std::size_t n = 0; n < answers.size(); ++n) sounding.reaction += stencil.weights[n] * answers[n]->reaction;
  const double worst = std::max(sum_near > 0.0 ? error_near / sum_near : 0.0, sum_far > 0.0 ? error_far / sum_far : 0.0);
  sounding.interpolation_db = 10.0 * std::log10(std::max(worst, 1e-30));
  return sounding;
}

// ---- coupling ----

/// Solutions at one wave number for a mixture. All of its motions were solved there.
Answer combine(const WaveAnswer& wave, const Mixture& mixture) {
  Answer sum;
  for (const std::int32_t i : mixture.motions) sum.order = std::max(sum.order, wave.modes.at(i).order);
  std::vector<Double> coefficient(count_harmonics(sum.order));
  for (std::size_t a = 0; a < mixture.motions.size(); ++a) {
    const Answer& one = wave.modes.at(mixture.motions[a]);
    for (std::size_t i = 0; i < one.coefficient.size(); ++i) coefficient[i] += mixture.parts[a] * Double(one.coefficient[i]);
    for (std::size_t b = 0; b < mixture.motions.size(); ++b)
      sum.reaction += mixture.parts[a] * mixture.parts[b] * Double(one.row[mixture.motions[b]]);
  }
  for (const Double& x : coefficient) sum.coefficient.emplace_back(x);
  return sum;
}

/// Air mass matrix of all modes, (n, n) symmetric: each pair at the two modes' own wave numbers, averaged. `mine`: the answers that a mode
/// reads.
template <typename Mine>
std::vector<double> calc_masses(std::size_t modes, const std::vector<Stencil>& stencils, double density, const Mine& mine) {
  std::vector<double> mass(modes * modes);
  for (std::size_t i = 0; i < modes; ++i)
    for (std::size_t n = 0; n < stencils[i].nodes.size(); ++n) {
      const std::vector<Single>& row = mine(i, n).modes.at(static_cast<std::int32_t>(i)).row;
      for (std::size_t j = 0; j < modes; ++j) {
        const double part = -0.5 * density * stencils[i].weights[n] * static_cast<double>(row[j].real());
        mass[i * modes + j] += part;
        mass[j * modes + i] += part;
      }
    }
  return mass;
}

/// Mass matrix of the motions of one mixture at its wave number.
std::vector<double> calc_masses_within(const std::vector<const WaveAnswer*>& waves, const Stencil& stencil, double density,
                                       const std::vector<std::int32_t>& motions) {
  const std::size_t count = motions.size();
  std::vector<double> mass(count * count);
  for (std::size_t n = 0; n < waves.size(); ++n)
    for (std::size_t a = 0; a < count; ++a) {
      const std::vector<Single>& row = waves[n]->modes.at(motions[a]).row;
      for (std::size_t b = 0; b < count; ++b) {
        const double part = -0.5 * density * stencil.weights[n] * static_cast<double>(row[motions[b]].real());
        mass[a * count + b] += part;
        mass[b * count + a] += part;
      }
    }
  return mass;
}

/// The mixture plus the rigid motions that are coupled to it above the threshold.
void add_rigid_motions(const std::vector<const WaveAnswer*>& waves, const Stencil& stencil, const CouplingOptions& options,
                       std::int32_t mode, std::size_t modes, Mixture& mixture) {
  const std::size_t motions = waves[0]->modes.at(mode).row.size();
  for (std::size_t r = modes; r < motions; ++r) {
    double mass = 0.0;
    for (std::size_t n = 0; n < waves.size(); ++n)
      mass -= options.density_kg_m3 * stencil.weights[n] * static_cast<double>(waves[n]->modes.at(mode).row[r].real());
    if (std::abs(mass) < options.kept) continue;
    mixture.motions.push_back(static_cast<std::int32_t>(r));
    mixture.parts.push_back(0.0);
  }
}

/// Largest asymmetry between two motions, relative to the mean of their own masses.
double calc_reciprocity(const std::map<double, WaveAnswer>& answers) {
  double worst = 0.0;
  for (const auto& [k, wave] : answers)
    for (const auto& [i, one] : wave.modes)
      for (const auto& [j, other] : wave.modes) {
        if (j <= i || one.row.empty() || other.row.empty()) continue;
        const double there = one.row[j].real(), back = other.row[i].real();
        worst = std::max(worst, std::abs(there - back) / std::sqrt(std::abs(one.reaction.real() * other.reaction.real()) + 1e-300));
      }
  return worst;
}

Radiator share(const comm::Communicator& comm, const Radiator& radiator) {
  return {comm.broadcast(radiator.nodes_m),  comm.broadcast(radiator.triangles),
          comm.broadcast(radiator.velocity), comm.broadcast(radiator.wave_number_1_m),
          comm.broadcast(radiator.sphere),   static_cast<std::size_t>(comm.broadcast(static_cast<std::int64_t>(radiator.rigid)))};
}

/// Velocities in the order of the surface's facets and corners.
std::vector<float> reorder(const RadiatingSurface& surface, const Radiator& radiator) {
  const std::size_t row = radiator.count_motions();
  std::vector<float> velocity(surface.count_facets() * 3 * row);
  for (std::size_t t = 0; t < surface.count_facets(); ++t) {
    const auto from = static_cast<std::size_t>(surface.get_facet_sources()[t]) * 3 * row;
    std::copy_n(radiator.velocity.begin() + static_cast<std::ptrdiff_t>(from), 3 * row,
                velocity.begin() + static_cast<std::ptrdiff_t>(t * 3 * row));
  }
  return velocity;
}

}  // namespace

std::vector<double> pack(const WaveAnswer& answer) {
  std::vector<double> packed{answer.k, static_cast<double>(answer.products), answer.residual, static_cast<double>(answer.modes.size())};
  for (const auto& [mode, found] : answer.modes) {
    packed.insert(packed.end(), {static_cast<double>(mode), static_cast<double>(found.order), found.reaction.real(), found.reaction.imag(),
                                 static_cast<double>(found.row.size())});
    for (const auto* numbers : {&found.coefficient, &found.row})
      for (const Single& x : *numbers) {
        packed.push_back(x.real());
        packed.push_back(x.imag());
      }
  }
  return packed;
}

std::optional<WaveAnswer> unpack(std::span<const double> packed) {
  const auto is_count = [](double x, double most) { return x >= 0.0 && x <= most && x == std::floor(x); };
  if (packed.size() < 4 || !(packed[0] > 0.0) || !is_count(packed[1], 1e6) || !is_count(packed[3], 1e6)) return std::nullopt;
  WaveAnswer answer{.k = packed[0], .modes = {}, .products = static_cast<std::int32_t>(packed[1]), .residual = packed[2]};
  std::size_t at = 4;
  for (auto left = static_cast<std::size_t>(packed[3]); left > 0; --left) {
    if (packed.size() - at < 5 || !is_count(packed[at], 1e6) || !is_count(packed[at + 1], kMostOrder) || !is_count(packed[at + 4], 1e6))
      return std::nullopt;
    Answer& mode = answer.modes[static_cast<std::int32_t>(packed[at])];
    mode.order = static_cast<std::int32_t>(packed[at + 1]);
    mode.reaction = {packed[at + 2], packed[at + 3]};
    const std::size_t harmonics = count_harmonics(mode.order), motions = packed[at + 4];
    at += 5;
    if ((packed.size() - at) / 2 < harmonics + motions) return std::nullopt;
    for (auto [numbers, count] : {std::pair(&mode.coefficient, harmonics), std::pair(&mode.row, motions)}) {
      numbers->clear();
      for (std::size_t i = 0; i < count; ++i, at += 2)
        numbers->emplace_back(static_cast<float>(packed[at]), static_cast<float>(packed[at + 1]));
    }
  }
  if (at != packed.size()) return std::nullopt;
  return answer;
}

std::int32_t find_order(double k_radius) { return std::min(kMostOrder, static_cast<std::int32_t>(std::ceil(k_radius)) + 12); }

namespace {

// ---- the solve ----

/// Input of all steps, the same on all ranks.
struct Problem {
  const comm::Communicator& comm;
  const Radiator& radiator;
  const AirSolveOptions& options;
  const Keeper& keeper;
  const BoundaryEquations& equations;
  const Group& group;
  double radius_m = 0.0;
  bool has_rows = false;
};

struct State {
  std::vector<double> modes;  // (n) wave numbers at which they are solved
  WaveNumbers waves;
  std::vector<Stencil> stencils{};         // (n) of `modes` in `waves`
  std::vector<Mixture> mixtures{};         // (n); empty: uncoupled modes. On ranks other than 0 the motions only
  std::map<double, WaveAnswer> answers{};  // by wave number, on rank 0

  const WaveAnswer& get_answer(std::size_t mode, std::size_t n) const { return answers.at(waves.get()[stencils[mode].nodes[n]]); }
  std::vector<const WaveAnswer*> list_answers(std::size_t mode) const {
    std::vector<const WaveAnswer*> list;
    for (std::size_t n = 0; n < stencils[mode].nodes.size(); ++n) list.push_back(&get_answer(mode, n));
    return list;
  }
  void add(WaveAnswer answer) {
    WaveAnswer& all = answers[answer.k];
    all.k = answer.k;
    all.products = std::max(all.products, answer.products);
    all.residual = std::max(all.residual, answer.residual);
    all.modes.merge(answer.modes);
  }
};

/// Motions to be solved at one wave number.
struct WaveTask {
  std::int32_t node = 0, order = 0;
  std::vector<std::int32_t> motions;
};

/// The missing solves, by wave number; sets the stencils. The same on all ranks. Collective.
std::vector<WaveTask> find_tasks(const Problem& problem, State& state) {
  struct Request {
    std::int32_t node, motion;
  };
  std::set<std::pair<std::int32_t, std::int32_t>> wanted;  // (wave number, motion)
  std::vector<std::int32_t> orders(state.waves.get().size());
  state.stencils.clear();
  for (std::size_t m = 0; m < state.modes.size(); ++m) {
    state.stencils.push_back(state.waves.find_stencil(state.modes[m]));
    for (const std::int32_t node : state.stencils.back().nodes) {
      wanted.emplace(node, static_cast<std::int32_t>(m));
      if (!state.mixtures.empty())
        for (const std::int32_t motion : state.mixtures[m].motions) wanted.emplace(node, motion);
      orders[node] = std::max(orders[node], find_order(state.modes[m] * problem.radius_m));
    }
  }
  const std::vector<Request> missing = problem.comm.broadcast([&] {
    std::vector<Request> list;
    for (const auto& [node, motion] : wanted) {
      const auto known = state.answers.find(state.waves.get()[node]);
      if (known == state.answers.end() || !known->second.modes.contains(motion)) list.push_back({node, motion});
    }
    return list;
  });
  std::vector<WaveTask> tasks;
  for (const Request& request : missing) {
    if (tasks.empty() || tasks.back().node != request.node) tasks.push_back({request.node, orders[request.node], {}});
    tasks.back().motions.push_back(request.motion);
  }
  return tasks;
}

/// Sends an answer of each group to rank 0, which saves it. `own`: null on ranks without one. Collective.
void collect_answers(const Problem& problem, const WaveAnswer* own, State& state) {
  const comm::Communicator& comm = problem.comm;
  const std::vector<double> packed = comm.agree([&] { return own != nullptr ? pack(*own) : std::vector<double>{}; });
  const std::vector<std::int64_t> sizes = comm.all_gather(std::vector<std::int64_t>{std::ssize(packed)});
  const std::vector<double> all = comm.all_gather(packed);
  comm.agree([&] {
    if (!comm.is_root()) return;
    std::span<const double> rest(all);
    for (const std::int64_t size : sizes) {
      if (size == 0) continue;
      WaveAnswer answer = unpack(rest.first(static_cast<std::size_t>(size))).value();
      rest = rest.subspan(static_cast<std::size_t>(size));
      if (problem.keeper.save) problem.keeper.save(answer);
      state.add(std::move(answer));
    }
  });
}

/// Solves what the modes read, a wave number per group at a time. Collective. Throws SolveStopped.
void solve_missing(const Problem& problem, int round, State& state) {
  const comm::Communicator& comm = problem.comm;
  const auto groups = static_cast<std::size_t>(problem.group.count());
  const std::vector<WaveTask> tasks = find_tasks(problem, state);
  for (std::size_t first = 0; first < tasks.size(); first += groups) {
    const std::size_t own = first + static_cast<std::size_t>(problem.group.get_number());
    const WaveAnswer answer = comm.agree([&] {
      if (own >= tasks.size()) return WaveAnswer{};
      return solve_wave(problem.equations, problem.group, state.waves.get()[tasks[own].node], tasks[own].order, tasks[own].motions,
                        problem.options.tolerance, problem.has_rows);
    });
    collect_answers(problem, own < tasks.size() && problem.group.is_first() ? &answer : nullptr, state);
    const std::size_t done = std::min(tasks.size(), first + groups);
    if (comm.is_root() && problem.keeper.report)
      problem.keeper.report(fmt::format("{}{} of {} wave numbers", round == 0 ? "" : "refinement, ", done, tasks.size()),
                            static_cast<double>(done) / static_cast<double>(tasks.size()));
    const bool is_stopped =
        comm.broadcast(static_cast<std::int32_t>(comm.is_root() && problem.keeper.is_stop_asked && problem.keeper.is_stop_asked())) != 0;
    if (is_stopped) throw SolveStopped();
  }
}

/// Updates the mixtures at their wave numbers. Returns the wave numbers of modes that are to be solved again. Collective.
std::vector<double> follow_mixtures(const Problem& problem, State& state, AirSolution& solution) {
  return problem.comm.broadcast([&] {
    std::vector<double> moved = state.modes;
    solution.unsettled = 0.0;
    for (std::size_t m = 0; m < moved.size(); ++m) {
      Mixture& mixture = state.mixtures[m];
      std::vector<double> wave_numbers;
      for (const std::int32_t i : mixture.motions)
        wave_numbers.push_back(i < std::ssize(moved) ? problem.radiator.wave_number_1_m[i] : 0.0);
      const std::vector<double> mass =
          calc_masses_within(state.list_answers(m), state.stencils[m], problem.options.coupling->density_kg_m3, mixture.motions);
      mixture = follow_mode(wave_numbers, mass, mixture);
      const double distance = std::abs(mixture.wave_number_1_m / state.modes[m] - 1.0);
      solution.unsettled = std::max(solution.unsettled, distance);
      if (distance > problem.options.coupling->settled) moved[m] = mixture.wave_number_1_m;
    }
    return moved;
  });
}

/// Interpolates all modes on rank 0. Returns the modes with too large an error. Collective.
std::vector<bool> interpolate_modes(const Problem& problem, const State& state, AirSolution& solution) {
  const double nearest_m = problem.options.nearest_over_radius * problem.radius_m;
  const std::vector<std::int32_t> wrong = problem.comm.broadcast([&] {
    std::vector<std::int32_t> list(state.modes.size());
    for (std::size_t m = 0; m < state.modes.size(); ++m) {
      std::vector<Answer> sums;
      std::vector<const Answer*> read;
      for (const WaveAnswer* wave : state.list_answers(m)) {
        if (state.mixtures.empty())
          read.push_back(&wave->modes.at(static_cast<std::int32_t>(m)));
        else
          sums.push_back(combine(*wave, state.mixtures[m]));
      }
      for (const Answer& sum : sums) read.push_back(&sum);
      std::int32_t order = 0;
      for (const Answer* one : read) order = std::max(order, one->order);
      solution.modes[m] = interpolate(read, state.stencils[m], calc_spread(state.modes[m], problem.radius_m, nearest_m, order));
      if (!state.mixtures.empty()) solution.modes[m].mixture = state.mixtures[m];
      list[m] = static_cast<std::int32_t>(solution.modes[m].interpolation_db > problem.options.error_db);
    }
    return list;
  });
  return {wrong.begin(), wrong.end()};
}

/// Makes the mixtures from uncoupled modes, and moves the modes to their wave numbers. Collective.
void couple(const Problem& problem, State& state) {
  struct Part {
    std::int32_t mode, motion;
  };
  std::vector<double> wave_numbers;
  const std::vector<Part> parts = problem.comm.broadcast([&] {
    const std::size_t count = state.modes.size();
    const CouplingOptions& options = *problem.options.coupling;
    const std::vector<double> mass = calc_masses(count, state.stencils, options.density_kg_m3,
                                                 [&](std::size_t m, std::size_t n) -> const WaveAnswer& { return state.get_answer(m, n); });
    state.mixtures = couple_modes(state.modes, mass, options.kept);
    std::vector<Part> list;
    for (std::size_t m = 0; m < count; ++m) {
      Mixture& mixture = state.mixtures[m];
      add_rigid_motions(state.list_answers(m), state.stencils[m], options, static_cast<std::int32_t>(m), count, mixture);
      wave_numbers.push_back(mixture.wave_number_1_m);
      for (const std::int32_t motion : mixture.motions) list.push_back({static_cast<std::int32_t>(m), motion});
    }
    return list;
  });
  state.modes = problem.comm.broadcast(std::move(wave_numbers));
  problem.comm.agree([&] {
    if (problem.comm.is_root()) return;
    state.mixtures.resize(state.modes.size());
    for (const Part& part : parts) state.mixtures[part.mode].motions.push_back(part.motion);
  });
}

}  // namespace

AirSolution solve_air(const comm::Communicator& comm, const Radiator& radiator_of_root, const AirSolveOptions& options,
                      const Keeper& keeper) {
  const Radiator radiator = share(comm, radiator_of_root);
  AirSolution solution;
  if (radiator.count_modes() == 0) return solution;
  const auto surface = comm.agree([&] { return std::make_unique<RadiatingSurface>(radiator.nodes_m, radiator.triangles); });
  std::vector<float> velocity = comm.agree([&] { return reorder(*surface, radiator); });
  StaticPart static_part = share_static_part(comm, *surface, velocity, radiator.count_motions());
  const auto equations = comm.agree([&] {
    return std::make_unique<BoundaryEquations>(*surface, radiator.sphere, std::move(velocity), radiator.count_motions(),
                                               std::move(static_part));
  });
  solution.sphere = equations->get_sphere();
  solution.unknowns = surface->count_nodes();
  solution.modes.resize(radiator.count_modes());
  const double radius_m = solution.sphere.radius_m;
  State state{.modes = radiator.wave_number_1_m, .waves = WaveNumbers(radiator.wave_number_1_m, radius_m, options.step)};
  const Group group(comm, solution.unknowns, options.matrix_bytes, state.waves.get().size());
  const bool has_rows = options.coupling && options.coupling->has_rows;
  const Problem problem{comm, radiator, options, keeper, *equations, group, radius_m, has_rows};
  comm.agree([&] {
    if (!comm.is_root() || !keeper.read) return;
    for (WaveAnswer& kept : keeper.read()) state.add(std::move(kept));
  });
  bool is_at_own_frequencies = true;  // of the modes without air
  for (int round = 0, steps = 0;; ++round) {
    solve_missing(problem, round, state);
    if (!state.mixtures.empty()) {
      std::vector<double> moved = follow_mixtures(problem, state, solution);
      if (steps < kSteps && moved != state.modes) {
        ++steps;
        state.modes = std::move(moved);
        continue;
      }
    }
    const std::vector<bool> wrong = interpolate_modes(problem, state, solution);
    if (round < kRounds && state.waves.refine(state.modes, wrong)) continue;
    if (!is_at_own_frequencies) break;
    is_at_own_frequencies = false;
    const bool is_coupled = comm.broadcast([&] {
      return static_cast<std::int32_t>(options.coupling && options.coupling->is_called_for &&
                                       options.coupling->is_called_for(solution.modes));
    }) != 0;
    if (is_coupled) {
      solution.lacks_rows = !has_rows;
      if (!has_rows) break;
      couple(problem, state);
      continue;
    }
    if (!options.shift) break;
    std::vector<double> shifted = comm.broadcast([&] {
      std::vector<double> list;
      for (std::size_t m = 0; m < state.modes.size(); ++m) list.push_back(options.shift(state.modes[m], solution.modes[m]));
      return list;
    });
    if (shifted == state.modes) break;
    state.modes = std::move(shifted);
  }
  solution.wave_number_1_m = state.modes;
  if (!state.mixtures.empty()) solution.reciprocity = calc_reciprocity(state.answers);
  for (const auto& [k, answer] : state.answers) {
    ++solution.wave_numbers;
    solution.products = std::max(solution.products, answer.products);
    solution.residual = std::max(solution.residual, answer.residual);
  }
  return solution;
}

}  // namespace carillon::air
