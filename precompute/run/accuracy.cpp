// Method: a coarse solve gives every mode's error bar in parts with known convergence rates, which predict the required mesh size; its cost
//   follows from the last trial's by the cost model, or by the exponent between two trials. The predicted setting is solved and its
//   corrected frequencies are compared with those of the coarser mesh; if the bars miss the target, the rate measured between two trials
//   replaces the known one.
// Source: precompute/fem/error_bars/correct.hpp (docs/error-bars.md); precompute/job/cost.
#include "precompute/run/accuracy.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <type_traits>

#include "precompute/eigen/memory.hpp"
#include "precompute/job/cost/memory.hpp"
#include "precompute/job/cost/seconds.hpp"
#include "precompute/mesh/parallel/read_parallel.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/run/io/checkpoint_file.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/base/failure.hpp"

namespace carillon::run {
namespace {

constexpr std::size_t kMaxTrials = 7;
constexpr std::int64_t kCoarseShapeNodes = 1500, kCoarseSurfaceNodes = 6000;
constexpr double kGoal = 0.85;          // safety factor of the target, so that the next trial is the last
constexpr double kFinestStep = 0.25;    // range of the convergence rates, see predict_level()
constexpr double kUnsureGrowth = 6.0;   // maximum, of the nodes until two meshes agree on the mode with the widest bar,
constexpr double kRoughGrowth = 3.0;    // and while an estimate is rough
constexpr double kLayered = 0.5;        // of the estimate of the widest bar: tractions, of which one layer leaves the most
constexpr double kLayeredGrowth = 1.1;  // of the nodes with the second layer: the edges in the plane become longer
constexpr double kApart = 0.5;          // maximum, of the corrections until then, so that the next mesh is far enough for a verdict,
constexpr double kApartSingular = 0.6;  // the same next to inward edges
constexpr double kSingular = 0.25;      // of the estimate of the widest bar: at inward edges
constexpr double kMinStep = 0.9;        // maximum: nearly equal edges give no new information
constexpr int kMaxCounts = 6;           // node counts tried per trial
constexpr int kMaxRefinements = 4;      // of a mesh file: 4,096 elements per element

/// To three digits, so that rounding on another number of ranks gives the same.
double round_hz(double hz) {
  const double unit = std::pow(10.0, std::floor(std::log10(hz)) - 2);
  return unit * std::round(hz / unit);
}

/// Next step of all ranks, decided on rank 0.
struct Decision {
  int is_done = 0;
  Setting setting;
};

static_assert(std::is_trivially_copyable_v<Decision>, "Decisions are sent as bytes.");

double calc_mean_edge(const comm::Communicator& comm, const mesh::LocalMesh& local) {
  std::array<double, 2> sum{};  // of lengths; number of edges
  for (auto tet = local.tets.begin(); tet != local.tets.end(); tet += local.nodes_per_tet())
    for (const auto& [a, b] : mesh::kEdges) {
      const Vec3 &p = local.nodes_m[tet[a]], &q = local.nodes_m[tet[b]];
      sum[0] += calc_length(p - q);
      sum[1] += 1;
    }
  comm.sum(sum);
  return sum[0] / sum[1];
}

class Search {
 public:
  explicit Search(Run& run) : run_(run), asked_(*run.job.accuracy_cents) {
    report_.asked_cents = asked_;
    tolerance_ = find_first_setting(run).tolerance;
  }
  Solution solve(AccuracyReport& report);

 private:
  void attempt(const Setting& setting);
  Trial judge(const Setting& setting, std::size_t first_phase);
  void judge_bars(Trial& trial) const;
  Decision decide();
  Decision decide_on_body();
  Decision decide_on_file();
  Setting make_setting(job::Element element, double ratio) const;
  const Trial* find_before(const Trial& trial) const;
  std::vector<error_bars::Level> list_coarser(const Trial& trial) const;
  double measure_exponent(double Trial::*quantity, double fallback, double min, double max) const;
  double find_dimension() const;
  double find_last_hz() const;
  bool are_reliable() const;
  const error_bars::ErrorParts* find_widest() const;
  double find_apart() const;
  bool wants_layer() const;
  double predict_worst(bool keeps_geometry, double ratio) const;
  double find_ratio(double goal_cents, double min) const;
  double find_worst(const error_bars::Corrections& corrections) const;
  void compare_levels();
  Forecast forecast(const Setting& setting, double ratio) const;
  Forecast forecast_next() const;
  std::string describe_surface(double cents) const;
  void check_forecast(const Setting& setting);
  std::string describe_reached() const;
  [[noreturn]] void give_up(const std::string& why) const;

  Run& run_;
  double asked_;
  double tolerance_;
  bool is_refinable_ = false;  // the mesh file can be refined: it is read by rank 0
  double order_ = 4.0;         // convergence order of the errors of the last trial
  AccuracyReport report_;
  Solution current_;
};

/// The previous trial with the same element.
const Trial* Search::find_before(const Trial& trial) const {
  for (auto before = report_.trials.rbegin(); before != report_.trials.rend(); ++before)
    if (before->setting.element == trial.setting.element && before->nodes < trial.nodes) return &*before;
  return nullptr;
}

/// Levels of the earlier trials with the same element, coarser meshes and modes.
std::vector<error_bars::Level> Search::list_coarser(const Trial& trial) const {
  std::vector<error_bars::Level> levels;
  for (const Trial& before : report_.trials)
    if (before.setting.element == trial.setting.element && before.nodes < trial.nodes && before.modes > 0) levels.push_back(before.level);
  return levels;
}

/// The widest bar of these.
double Search::find_worst(const error_bars::Corrections& corrections) const {
  double worst = 0.0;
  for (const std::size_t m : find_bank_modes(run_.job, corrections)) worst = std::max(worst, corrections.cents[m]);
  return worst;
}

/// Largest bar predicted on a mesh with edges `ratio` times as long, compared with this one. A refined mesh file keeps its facets.
double Search::predict_worst(bool keeps_geometry, double ratio) const {
  const error_bars::Level& level = current_.solved.errors.bars.level;
  if (level.parts.empty()) return 0.0;
  std::vector<error_bars::Level> coarser = list_coarser(report_.trials.back());
  coarser.push_back(level);
  return find_worst(error_bars::calc_corrections(error_bars::predict_level(level, order_, keeps_geometry, ratio), coarser));
}

/// Largest edge ratio predicted to meet the goal; `min` if none above it does.
double Search::find_ratio(double goal_cents, double min) const {
  if (predict_worst(false, min) > goal_cents) return min;
  double low = min, high = 1.0;
  for (int i = 0; i < 20; ++i) {
    const double middle = std::sqrt(low * high);
    (predict_worst(false, middle) <= goal_cents ? low : high) = middle;
  }
  return low;
}

/// Compares the last trial with the previous ones: corrections on which two agree, and the convergence order.
void Search::compare_levels() {
  error_bars::ErrorBars& bars = current_.solved.errors.bars;
  const Trial& last = report_.trials.back();
  const Trial* before = find_before(last);
  const error_bars::Level* coarser = before == nullptr || before->modes == 0 ? nullptr : &before->level;
  order_ = error_bars::find_order(bars.level, coarser, before == nullptr ? 1.0 : before->edge_m / last.edge_m);
  if (coarser != nullptr && !bars.level.parts.empty()) bars.corrected = error_bars::calc_corrections(bars.level, list_coarser(last));
}

double Search::measure_exponent(double Trial::*quantity, double fallback, double min, double max) const {
  const Trial& last = report_.trials.back();
  const Trial* before = find_before(last);
  if (before == nullptr || static_cast<double>(last.nodes) < 1.5 * static_cast<double>(before->nodes)) return fallback;
  const double nodes = std::log(static_cast<double>(last.nodes) / static_cast<double>(before->nodes));
  return std::clamp(std::log(last.*quantity / before->*quantity) / nodes, min, max);
}

/// The last computed mode of "max_modes"; 0 if the band ends before it.
double Search::find_last_hz() const {
  const std::vector<double>& lambda = current_.solved.errors.bars.corrected.lambda;
  if (lambda.empty() || find_computed_count(run_.job) != static_cast<std::int64_t>(lambda.size())) return 0.0;
  return round_hz(std::sqrt(*std::ranges::max_element(lambda)) / (2 * std::numbers::pi));
}

/// No mode of the bank is rough or stiff.
bool Search::are_reliable() const {
  const error_bars::Corrections& corrections = current_.solved.errors.bars.corrected;
  return std::ranges::all_of(find_bank_modes(run_.job, corrections),
                             [&](std::size_t m) { return bank::is_reliable(corrections.correction[m]); });
}

/// Parts of the widest bar; null without modes.
const error_bars::ErrorParts* Search::find_widest() const {
  const error_bars::ErrorBars& bars = current_.solved.errors.bars;
  const std::vector<std::size_t> listed = find_bank_modes(run_.job, bars.corrected);
  const auto widest =
      std::ranges::max_element(listed, {}, [&](std::size_t m) { return bars.algebraic_cents[m] + bars.corrected.cents[m]; });
  return widest == listed.end() ? nullptr : &bars.level.parts[*widest];
}

/// Largest edge ratio of a mesh whose estimate differs enough for a verdict. Where much of it is at inward edges, the second mesh shows
/// that all of it falls with their order.
double Search::find_apart() const {
  const error_bars::ErrorParts* parts = find_widest();
  const bool is_singular = parts != nullptr && report_.trials.size() == 1 && parts->singular > kSingular * parts->interpolation;
  const double ratio =
      is_singular ? std::pow(kApartSingular, 1.0 / std::min(order_, error_bars::kSingularOrder)) : std::pow(kApart, 1.0 / order_);
  return std::min(kMinStep, ratio);
}

/// One layer of T10 bends with a constant shear through the thickness, however fine it is in the plane, and leaves its traction on the
/// faces.
bool Search::wants_layer() const {
  if (run_.job.body->shape.empty() || report_.trials.back().setting.layers > 1) return false;
  const error_bars::ErrorParts* parts = find_widest();
  return parts != nullptr && parts->tractions > kLayered * parts->interpolation;
}

/// Growth exponent of the nodes with 1 / edge length: thin bodies refine in two directions.
double Search::find_dimension() const {
  const bool is_thin = current_.solved.errors.bars.level.one_layer > 0.5;
  return -1.0 / measure_exponent(&Trial::edge_m, is_thin ? -1.0 / 2 : -1.0 / 3, -1.0 / 2, -1.0 / 3.3);
}

/// Peak memory of all ranks for `size`, scaled from a trial.
double calc_bytes(const Trial& trial, const cost::ProblemSize& size) {
  return static_cast<double>(trial.peak_bytes) * cost::predict_bytes(size, 1) / cost::predict_bytes(trial.size, 1);
}

/// From the last trial to edges `ratio` times as long.
Forecast Search::forecast(const Setting& setting, double ratio) const {
  const Trial& last = report_.trials.back();
  Forecast next;
  next.setting = setting;
  const double growth = std::pow(ratio, -find_dimension());
  next.nodes = static_cast<double>(last.nodes) * growth;
  next.worst_cents = predict_worst(setting.refinements > last.setting.refinements, ratio) + last.algebraic_cents;
  const cost::ProblemSize finer = cost::refine(last.size, growth);
  const double slower = cost::predict_seconds(finer).sum() / cost::predict_seconds(last.size).sum();
  const double predicted = growth == 1.0 ? 1.0 : std::log(slower) / std::log(growth);
  next.cpu_seconds = last.cpu_seconds * std::pow(growth, measure_exponent(&Trial::cpu_seconds, predicted, 1.0, 2.2));
  next.bytes = calc_bytes(last, finer);
  return next;
}

Setting Search::make_setting(job::Element element, double ratio) const {
  const Trial& last = report_.trials.back();
  Setting setting = last.setting;
  setting.element = element;
  setting.tolerance = tolerance_;
  setting.expected_hz = find_last_hz();
  setting.extrudes = last.setting.extrudes || current_.body.is_extruded;  // finer ones would be far slower to make, and compare worse
  setting.nodes = std::llround(static_cast<double>(last.nodes) * std::pow(ratio, -find_dimension()));
  return setting;
}

std::string Search::describe_reached() const {
  std::string text = fmt::format("{:g} cents were requested", asked_);
  const Trial* best = nullptr;
  for (const Trial& trial : report_.trials)
    if (trial.modes > 0 && (best == nullptr || trial.worst_cents < best->worst_cents)) best = &trial;
  if (best == nullptr) return text + ", and no mode was found in the band";
  return text + fmt::format(", and {:.3g} reached (at {:.1f} Hz, {}, {} nodes, {:.1f} CPU s)", best->worst_cents, best->worst_hz,
                            run::describe(best->setting), best->nodes, best->cpu_seconds);
}

std::string describe_forecast(const Forecast& next) {
  return fmt::format("next stricter: {}, about {:.0f} nodes, {}, {:.1f} CPU s, {:.2g} GB",
                     next.needs_new_mesh ? "a mesh file with edges half as long" : run::describe(next.setting), next.nodes,
                     next.worst_cents > 0 ? fmt::format("{:.2g} cents", next.worst_cents) : std::string("cents unknown"), next.cpu_seconds,
                     next.bytes / 1e9);
}

void Search::give_up(const std::string& why) const {
  throw SolveError(fmt::format("{}: key 'accuracy_cents': {}; {}; {}", run_.job.file.string(), describe_reached(), why,
                               describe_forecast(forecast_next())));
}

/// Why a mesh file with an inexact surface converges to `cents`, and the remedy.
std::string Search::describe_surface(double cents) const {
  const mesh::CheckReport& check = current_.body.check;
  const std::string end =
      fmt::format("with infinite refinement this mesh would reach {:.3g}, because its surface is not that of the body", cents);
  if (check.straightened > 0)
    return end + fmt::format(
                     ": it has ten-node elements, but {} of its {} elements folded over and were straightened, which leaves "
                     "their faces flat; use smaller elements where the surface bends, or give the surface itself (\"body\")",
                     check.straightened, check.tets);
  if (check.order == 2 && check.curved == 0)
    return end +
           ": it has ten-node elements, but all its edges are straight; move the mid-side nodes onto the true surface, or give the surface "
           "itself (\"body\")";
  if (check.order == 2)
    return end +
           " between its nodes, despite its ten-node elements; use a finer mesh with ten-node elements, or the surface itself (\"body\")";
  return end + "; use a finer mesh, ten-node elements on the true surface, or the surface itself (\"body\")";
}

/// Rank 0: next setting of a body meshed by the run.
Decision Search::decide_on_body() {
  const Trial& last = report_.trials.back();
  if (last.modes == 0) return {0, make_setting(last.setting.element, 0.5)};
  // Errors estimated on one mesh are often twenty times too large; two meshes that agree tell more.
  if (wants_layer()) {
    Setting setting = make_setting(last.setting.element, std::pow(kLayeredGrowth, -1.0 / find_dimension()));
    setting.layers = 2;
    return {0, setting};
  }
  const bool is_reliable = are_reliable(), is_agreed = is_reliable && last.correction == bank::Correction::kTwoMeshes;
  const double finest = is_agreed ? kFinestStep : std::pow(is_reliable ? kUnsureGrowth : kRoughGrowth, -1.0 / find_dimension());
  const double longest = is_agreed ? kMinStep : find_apart();
  const double ratio = find_ratio(kGoal * asked_, finest);
  return {0, make_setting(last.setting.element, std::clamp(ratio, finest, std::max(finest, longest)))};
}

/// Rank 0: next setting of a mesh file: T4, T10, T10 refined.
Decision Search::decide_on_file() {
  const Trial& last = report_.trials.back();
  Setting setting = last.setting;
  setting.tolerance = tolerance_;
  setting.expected_hz = find_last_hz();
  if (last.setting.element == job::Element::T4) {
    setting.element = job::Element::T10;
    return {0, setting};
  }
  if (!is_refinable_) give_up("this mesh file is read in parallel and cannot be refined; make a finer one");
  int more = 1;
  while (more < kMaxRefinements && predict_worst(true, std::pow(0.5, more)) > asked_) ++more;
  const double facets = predict_worst(true, 1e-3);
  if (last.modes > 0 && facets > asked_) give_up(describe_surface(facets));
  setting.refinements += more;
  if (setting.refinements > kMaxRefinements)
    give_up(fmt::format("{} uniform refinements would not suffice; use a finer mesh where the body is thin or has sharp corners",
                        kMaxRefinements));
  return {0, setting};
}

Decision Search::decide() {
  const Trial& last = report_.trials.back();
  if (last.modes > 0 && last.worst_cents <= asked_) return {1, last.setting};
  if (const Trial* before = find_before(last); last.modes == 0 && before != nullptr && before->modes == 0)
    return {1, last.setting};  // no modes on two meshes: the band is empty
  if (last.modes > 0 && last.algebraic_cents > 0.2 * asked_) tolerance_ = std::max(tolerance_ * 1e-2, 1e-12);
  if (report_.trials.size() >= kMaxTrials) give_up(fmt::format("{} settings were tried; relax the target, or give the mesh", kMaxTrials));
  return run_.job.body ? decide_on_body() : decide_on_file();
}

/// Rejects settings beyond the memory of the machine.
void Search::check_forecast(const Setting& setting) {
  double bytes = 0.0;
  if (run_.comm.is_root()) {
    const Trial& last = report_.trials.back();
    double ratio = 1.0;
    if (setting.element == last.setting.element && setting.nodes)
      ratio = std::pow(static_cast<double>(*setting.nodes) / static_cast<double>(last.nodes), -1.0 / find_dimension());
    if (setting.refinements > last.setting.refinements) ratio = std::pow(0.5, setting.refinements - last.setting.refinements);
    bytes = ratio < 1.0 ? forecast(setting, ratio).bytes - static_cast<double>(last.peak_bytes) : 0.0;
  }
  bytes = run_.comm.broadcast(bytes);
  eigen::check_memory(run_.comm, static_cast<std::int64_t>(std::clamp(bytes, 0.0, 1e18) / run_.comm.size()),
                      run_.options.get_memory_limit_bytes(), "The next setting (" + run::describe(setting) + ")");
}

Trial Search::judge(const Setting& setting, std::size_t first_phase) {
  const SolvedBody& solved = current_.solved;
  Trial trial;
  trial.setting = setting;
  trial.nodes = current_.body.pieces.nodes;
  trial.tets = current_.body.pieces.tets;
  trial.edge_m = calc_mean_edge(run_.comm, current_.body.pieces.local);
  trial.modes = solved.modes.lambda.size();
  trial.size = find_problem_size(run_, setting, current_.body);
  trial.size.factor_flops = solved.modes.factor.flops;
  trial.size.factor_entries = solved.modes.factor.entries;
  trial.size.modes = static_cast<std::int64_t>(trial.modes);
  const auto& phases = run_.log.get_phases();
  for (std::size_t i = first_phase; i < phases.size(); ++i) trial.cpu_seconds += phases[i].cpu_seconds;
  trial.peak_bytes = phases.back().peak_sum_bytes;
  trial.level = solved.errors.bars.level;
  return trial;
}

/// Sets the widest bar of the last trial and its frequency.
void Search::judge_bars(Trial& trial) const {
  const error_bars::ErrorBars& bars = current_.solved.errors.bars;
  const std::vector<std::size_t> listed = find_bank_modes(run_.job, bars.corrected);
  trial.modes = listed.size();
  for (const std::size_t k : listed) {
    const double cents = bars.algebraic_cents[k] + bars.corrected.cents[k];
    trial.algebraic_cents = std::max(trial.algebraic_cents, bars.algebraic_cents[k]);
    if (!bars.corrected.facet_cents.empty()) trial.facet_cents = std::max(trial.facet_cents, bars.corrected.facet_cents[k]);
    if (cents <= trial.worst_cents) continue;
    trial.worst_cents = cents;
    trial.worst_hz = std::sqrt(bars.corrected.lambda[k]) / (2 * std::numbers::pi);
    trial.correction = bars.corrected.correction[k];
  }
}

void Search::attempt(const Setting& setting) {
  current_ = {};  // frees memory for the next body
  const std::size_t first_phase = run_.log.get_phases().size();
  current_.setting = setting;
  current_.body = make_trial_body(run_, current_.setting);
  current_.solved = solve_body(run_, current_.setting, current_.body);
  report_.trials.push_back(judge(current_.setting, first_phase));
  compare_levels();
  Trial& trial = report_.trials.back();
  judge_bars(trial);
  run_.log.print(trial.modes == 0
                     ? std::string("no mode in the band")
                     : fmt::format("error bars up to {:.3g} cents (at {:.1f} Hz{}); {:g} requested", trial.worst_cents, trial.worst_hz,
                                   trial.correction == bank::Correction::kDisputed ? ", two meshes contradict each other" : "", asked_));
}

Forecast Search::forecast_next() const {
  const Trial& last = report_.trials.back();
  constexpr double kHalf = 0.5;  // edge ratio if the error bars predict none
  if (run_.job.body) {
    const double ratio = last.modes == 0 ? kHalf : std::min(find_ratio(0.5 * last.worst_cents, kFinestStep), kMinStep);
    return forecast(make_setting(last.setting.element, ratio), ratio);
  }
  Setting setting = last.setting;
  if (last.setting.element == job::Element::T4) {
    setting.element = job::Element::T10;
    const cost::ProblemSize quadratic = cost::make_quadratic(last.size);
    const double slower = cost::predict_seconds(quadratic).sum() / cost::predict_seconds(last.size).sum();
    return {setting, false, static_cast<double>(quadratic.nodes), 0.0, slower * last.cpu_seconds, calc_bytes(last, quadratic)};
  }
  const bool is_refined = is_refinable_ && setting.refinements < kMaxRefinements;
  if (is_refined) ++setting.refinements;  // keeps the facets, as forecast() assumes
  Forecast next = forecast(setting, kHalf);
  next.needs_new_mesh = !is_refined;
  return next;
}

Solution Search::solve(AccuracyReport& report) {
  const Setting setting = find_first_setting(run_);
  if (!run_.job.body) {
    run_.comm.agree([&] { is_refinable_ = run_.comm.is_root() && !parallel_mesh::is_parallel_format(run_.job.mesh); });
  }
  for (Decision decision{0, setting}; decision.is_done == 0;) {
    const std::string reached = report_.trials.empty() ? "" : describe_reached() + ". ";
    try {
      if (!report_.trials.empty()) check_forecast(decision.setting);
      attempt(decision.setting);
    } catch (const std::exception&) {
      rethrow_after(reached);
    }
    run_.comm.agree([&] {
      if (run_.comm.is_root()) decision = decide();
      // A resumed run takes the setting of the interrupted one.
      if (const Setting* kept = run_.checkpoint ? run_.checkpoint->find_setting(report_.trials.size()) : nullptr;
          kept != nullptr && decision.is_done == 0)
        decision.setting = *kept;
    });
    decision = run_.comm.broadcast(decision);
  }
  if (run_.comm.is_root()) {
    report_.next = forecast_next();
    const Trial& last = report_.trials.back();
    const std::string reached = last.modes == 0 ? std::string("no mode in the band, and none on the coarser meshes")
                                                : fmt::format("error bars up to {:.3g} cents of {:g} requested", last.worst_cents, asked_);
    run_.log.print(
        fmt::format("chosen: {}, {} nodes: {}, {:.1f} CPU s", run::describe(last.setting), last.nodes, reached, last.cpu_seconds));
    run_.log.print(describe_forecast(report_.next));
  }
  report = std::move(report_);
  return std::move(current_);
}

base::Json describe_setting(const Setting& setting) {
  base::Json value;
  value.set("element", job::to_text(setting.element)).set("tolerance", setting.tolerance);
  if (setting.nodes) value["body_nodes"] = *setting.nodes;
  if (setting.layers > 1) value["body_layers"] = setting.layers;
  if (setting.edge_m) value["body_edge_m"] = *setting.edge_m;
  if (setting.refinements > 0) value["refinements"] = setting.refinements;
  return value;
}

}  // namespace

Setting find_first_setting(const Run& run) {
  Setting setting;
  setting.tolerance = std::clamp(2e-8 * run.job.accuracy_cents.value_or(0), 1e-10, 1e-6);
  setting.element = run.job.body ? job::Element::T10 : job::Element::T4;
  if (run.job.body) setting.nodes = run.job.body->shape.empty() ? kCoarseSurfaceNodes : kCoarseShapeNodes;
  return setting;
}

namespace {

/// Rejects a node count suggested by the mesher that this machine cannot solve, before meshing.
void check_count(const Run& run, const Setting& setting) {
  constexpr double kSurely = 0.5;  // lower bound of a factor extrapolated to a factor of two
  const cost::ProblemSize size = cost::estimate_meshed_size(setting.nodes.value_or(0), setting.element == job::Element::T10);
  const auto bytes = static_cast<std::int64_t>(kSurely * cost::predict_parts(size).factor);
  eigen::check_memory(run.comm, bytes / run.comm.size(), run.options.get_memory_limit_bytes(),
                      fmt::format("The coarsest mesh of this body ({} nodes)", size.nodes));
}

}  // namespace

Body make_trial_body(Run& run, Setting& setting) {
  for (int count = 1;; ++count) {
    try {
      return make_body(run, setting);
    } catch (const CountRefusal& refusal) {
      std::int64_t nodes = refusal.get_possible_nodes();
      if (nodes == setting.nodes || count == kMaxCounts) throw;
      // The mesher names a number that it is sure of; often far fewer suffice.
      if (setting.nodes && nodes > 2 * *setting.nodes) nodes = 2 * *setting.nodes;
      run.log.print(fmt::format("{} nodes cannot be met on this body; {} are tried", setting.nodes.value_or(0), nodes));
      setting.nodes = nodes;
      check_count(run, setting);
    } catch (const InputError&) {
      if (!setting.extrudes) throw;
      setting.extrudes = false;
    }
  }
}

Solution solve_to_accuracy(Run& run, AccuracyReport& report) { return Search(run).solve(report); }

std::string describe(const Setting& setting) {
  std::string text = job::to_text(setting.element);
  if (setting.nodes) text += fmt::format(", meshed with {} nodes", *setting.nodes);
  if (setting.edge_m) text += fmt::format(", meshed with edges of {:.3g} m", *setting.edge_m);
  if (setting.refinements > 0) text += fmt::format(", refined {} time{}", setting.refinements, setting.refinements == 1 ? "" : "s");
  return text + fmt::format(", tolerance {:.0e}", setting.tolerance);
}

base::Json describe_accuracy(const AccuracyReport& report) {
  base::Json root;
  root["asked_cents"] = report.asked_cents;
  for (const Trial& trial : report.trials) {
    base::Json entry = describe_setting(trial.setting);
    entry.set("nodes", trial.nodes).set("tets", trial.tets).set("mean_edge_m", trial.edge_m).set("modes", trial.modes);
    entry.set("worst_cents", trial.worst_cents).set("worst_hz", trial.worst_hz).set("algebraic_cents", trial.algebraic_cents);
    entry.set("facet_cents", trial.facet_cents).set("cpu_seconds", trial.cpu_seconds).set("peak_bytes_all_ranks", trial.peak_bytes);
    root["trials"].append(entry);
  }
  if (!report.trials.empty()) root["chosen"] = root["trials"][report.trials.size() - 1];
  if (report.next.nodes > 0) {
    base::Json& next = root["next_stricter"] = describe_setting(report.next.setting);
    if (report.next.needs_new_mesh) next["needs_new_mesh"] = true;
    next.set("nodes", std::round(report.next.nodes));
    next.set("worst_cents", report.next.worst_cents > 0 ? base::Json(report.next.worst_cents) : base::Json());
    next.set("cpu_seconds", report.next.cpu_seconds).set("peak_bytes_all_ranks", std::round(report.next.bytes));
  }
  return root;
}

}  // namespace carillon::run
