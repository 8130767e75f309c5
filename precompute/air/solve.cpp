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
#include <numeric>
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

AirSolution solve_air(const comm::Communicator& comm, const Radiator& radiator_of_root, const AirSolveOptions& options,
                      const Keeper& keeper) {
  const Radiator radiator = share(comm, radiator_of_root);
  AirSolution solution;
  if (radiator.count_modes() == 0) return solution;
  const auto surface = comm.agree([&] { return std::make_unique<RadiatingSurface>(radiator.nodes_m, radiator.triangles); });
  const auto equations = comm.agree([&] {
    return std::make_unique<BoundaryEquations>(*surface, radiator.sphere, reorder(*surface, radiator), radiator.count_motions());
  });
  std::vector<double> modes = radiator.wave_number_1_m;
  solution.sphere = equations->get_sphere();
  solution.unknowns = surface->count_nodes();
  const double radius = solution.sphere.radius_m, nearest = options.nearest_over_radius * radius;
  WaveNumbers waves(modes, radius, options.step);
  const Group group(comm, solution.unknowns, options.matrix_bytes, waves.get().size());
  std::map<double, WaveAnswer> answers;  // on rank 0
  const auto add_answer = [&](WaveAnswer answer) {
    WaveAnswer& all = answers[answer.k];
    all.k = answer.k;
    all.products = std::max(all.products, answer.products);
    all.residual = std::max(all.residual, answer.residual);
    all.modes.merge(answer.modes);
  };
  comm.agree([&] {
    if (!comm.is_root() || !keeper.read) return;
    for (WaveAnswer& kept : keeper.read()) add_answer(std::move(kept));
  });
  solution.modes.resize(modes.size());
  const bool has_rows = options.coupling && options.coupling->has_rows;
  enum class Stage : std::uint8_t { kAlone, kShifted, kCoupled } stage = Stage::kAlone;
  int steps = 0;
  std::vector<Mixture> mixtures;  // (n) once modes are coupled; on other ranks the motions only
  for (int round = 0;; ++round) {
    // Pending (wave number, modes). The same on all ranks.
    std::vector<Stencil> stencils;
    std::map<std::int32_t, std::set<std::int32_t>> readers;
    std::vector<std::int32_t> orders(waves.get().size());
    for (std::size_t m = 0; m < modes.size(); ++m) {
      stencils.push_back(waves.find_stencil(modes[m]));
      for (const std::int32_t node : stencils.back().nodes) {
        readers[node].insert(static_cast<std::int32_t>(m));
        if (!mixtures.empty()) readers[node].insert(mixtures[m].motions.begin(), mixtures[m].motions.end());
        orders[node] = std::max(orders[node], find_order(modes[m] * radius));
      }
    }
    std::vector<std::int32_t> wanted = comm.broadcast([&] {
      std::vector<std::int32_t> list;  // wave number, count, modes ...
      for (const auto& [node, who] : readers) {
        const auto known = answers.find(waves.get()[node]);
        std::vector<std::int32_t> lacking;
        for (const std::int32_t m : who)
          if (known == answers.end() || !known->second.modes.contains(m)) lacking.push_back(m);
        if (lacking.empty()) continue;
        list.insert(list.end(), {node, static_cast<std::int32_t>(lacking.size())});
        list.insert(list.end(), lacking.begin(), lacking.end());
      }
      return list;
    });
    std::vector<std::pair<std::int32_t, std::vector<std::int32_t>>> work;
    for (std::size_t at = 0; at < wanted.size(); at += 2 + static_cast<std::size_t>(wanted[at + 1]))
      work.emplace_back(wanted[at], std::vector<std::int32_t>(wanted.begin() + static_cast<std::ptrdiff_t>(at) + 2,
                                                              wanted.begin() + static_cast<std::ptrdiff_t>(at) + 2 + wanted[at + 1]));
    for (std::size_t first = 0; first < work.size(); first += static_cast<std::size_t>(group.count())) {
      const std::size_t own_work = first + static_cast<std::size_t>(group.get_number());
      const WaveAnswer answer = comm.agree([&] {
        if (own_work >= work.size()) return WaveAnswer{};
        const std::size_t node = work[own_work].first;
        return solve_wave(*equations, group, waves.get()[node], orders[node], work[own_work].second, options.tolerance, has_rows);
      });
      const std::vector<double> packed = comm.all_gather([&] {
        std::vector<double> own;
        if (own_work >= work.size() || !group.is_first()) return own;
        own = pack(answer);
        own.insert(own.begin(), static_cast<double>(own.size()));
        return own;
      });
      comm.agree([&] {
        if (!comm.is_root()) return;
        for (std::size_t at = 0; at < packed.size(); at += 1 + static_cast<std::size_t>(packed[at])) {
          WaveAnswer home = unpack(std::span(packed).subspan(at + 1, packed[at])).value();
          if (keeper.save) keeper.save(home);
          add_answer(std::move(home));
        }
      });
      const std::size_t done = std::min(work.size(), first + static_cast<std::size_t>(group.count()));
      if (comm.is_root() && keeper.report)
        keeper.report(fmt::format("{}{} of {} wave numbers", round == 0 ? "" : "refinement, ", done, work.size()),
                      static_cast<double>(done) / static_cast<double>(work.size()));
      const bool is_stopped =
          comm.broadcast(static_cast<std::int32_t>(comm.is_root() && keeper.is_stop_asked && keeper.is_stop_asked())) != 0;
      if (is_stopped) throw SolveStopped();
    }
    // Answers that a mode reads, on rank 0.
    const auto mine = [&](std::size_t m, std::size_t n) -> const WaveAnswer& { return answers.at(waves.get()[stencils[m].nodes[n]]); };
    const auto list_mine = [&](std::size_t m) {
      std::vector<const WaveAnswer*> list;
      for (std::size_t n = 0; n < stencils[m].nodes.size(); ++n) list.push_back(&mine(m, n));
      return list;
    };
    if (stage == Stage::kCoupled) {
      std::vector<double> moved = comm.broadcast([&] {
        std::vector<double> list = modes;
        solution.unsettled = 0.0;
        for (std::size_t m = 0; m < modes.size(); ++m) {
          std::vector<double> wave_numbers;
          for (const std::int32_t i : mixtures[m].motions)
            wave_numbers.push_back(i < std::ssize(modes) ? radiator.wave_number_1_m[i] : 0.0);
          mixtures[m] =
              follow_mode(wave_numbers, calc_masses_within(list_mine(m), stencils[m], options.coupling->density_kg_m3, mixtures[m].motions),
                          mixtures[m]);
          const double distance = std::abs(mixtures[m].wave_number_1_m / modes[m] - 1.0);
          solution.unsettled = std::max(solution.unsettled, distance);
          if (distance > options.coupling->settled) list[m] = mixtures[m].wave_number_1_m;
        }
        return list;
      });
      if (steps < kSteps && moved != modes) {
        ++steps;
        modes = std::move(moved);
        continue;
      }
    }
    std::vector<std::int32_t> wrong = comm.broadcast([&] {
      std::vector<std::int32_t> list(modes.size());
      for (std::size_t m = 0; m < modes.size(); ++m) {
        std::vector<Answer> sums;
        std::vector<const Answer*> read;
        for (const WaveAnswer* wave : list_mine(m)) {
          if (stage == Stage::kCoupled)
            sums.push_back(combine(*wave, mixtures[m]));
          else
            read.push_back(&wave->modes.at(static_cast<std::int32_t>(m)));
        }
        for (const Answer& sum : sums) read.push_back(&sum);
        std::int32_t order = 0;
        for (const Answer* one : read) order = std::max(order, one->order);
        solution.modes[m] = interpolate(read, stencils[m], calc_spread(modes[m], radius, nearest, order));
        if (stage == Stage::kCoupled) solution.modes[m].mixture = mixtures[m];
        list[m] = static_cast<std::int32_t>(solution.modes[m].interpolation_db > options.error_db);
      }
      return list;
    });
    if (round < kRounds && waves.refine(modes, std::vector<bool>(wrong.begin(), wrong.end()))) continue;
    if (stage != Stage::kAlone) break;
    const bool is_coupled = comm.broadcast([&] {
      return static_cast<std::int32_t>(options.coupling && options.coupling->is_called_for &&
                                       options.coupling->is_called_for(solution.modes));
    }) != 0;
    if (is_coupled) {
      solution.lacks_rows = !has_rows;
      if (!has_rows) break;
      stage = Stage::kCoupled;
      // Of each mode its wave number, how many motions it has, and which.
      const std::vector<double> list = comm.broadcast([&] {
        std::vector<double> numbers;
        const std::vector<double> mass = calc_masses(modes.size(), stencils, options.coupling->density_kg_m3, mine);
        mixtures = couple_modes(modes, mass, options.coupling->kept);
        for (std::size_t m = 0; m < modes.size(); ++m) {
          add_rigid_motions(list_mine(m), stencils[m], *options.coupling, static_cast<std::int32_t>(m), modes.size(), mixtures[m]);
          numbers.insert(numbers.end(), {mixtures[m].wave_number_1_m, static_cast<double>(mixtures[m].motions.size())});
          numbers.insert(numbers.end(), mixtures[m].motions.begin(), mixtures[m].motions.end());
        }
        return numbers;
      });
      comm.agree([&] {
        mixtures.resize(modes.size());
        std::size_t at = 0;
        for (std::size_t m = 0; m < modes.size(); ++m) {
          modes[m] = list[at];
          const auto first = list.begin() + static_cast<std::ptrdiff_t>(at) + 2, last = first + static_cast<std::ptrdiff_t>(list[at + 1]);
          mixtures[m].motions.assign(first, last);
          at += 2 + mixtures[m].motions.size();
        }
      });
      continue;
    }
    stage = Stage::kShifted;
    if (!options.shift) break;
    std::vector<double> shifted = comm.broadcast([&] {
      std::vector<double> list;
      for (std::size_t m = 0; m < modes.size(); ++m) list.push_back(options.shift(modes[m], solution.modes[m]));
      return list;
    });
    if (shifted == modes) break;
    modes = std::move(shifted);
  }
  solution.wave_number_1_m = modes;
  if (stage == Stage::kCoupled) solution.reciprocity = calc_reciprocity(answers);
  for (const auto& [k, answer] : answers) {
    ++solution.wave_numbers;
    solution.products = std::max(solution.products, answer.products);
    solution.residual = std::max(solution.residual, answer.residual);
  }
  return solution;
}

}  // namespace carillon::air
