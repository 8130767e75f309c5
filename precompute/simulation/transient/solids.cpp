// Method: consecutive elements of equal kind and law form a run; a run is split into blocks of the processor's lane count, and the last
//   block is padded with its last element at weight 0. Loops: kernel.cpp. docs/equations.md E11.
#include "precompute/simulation/transient/solids.hpp"

#include <algorithm>

namespace carillon::transient {

void AlignedDoubles::resize(std::size_t count) {
  lines_.assign((count + 7) / 8, Line{});
  count_ = count;
}

BlockRun Solids::Run::view() const { return {blocks, shape.data(), read.data(), write.data(), nullptr, nullptr, law}; }

Solids::Solids(const std::vector<SolidElement>& elements, const std::vector<Law>& laws, const std::vector<Vec3>& places_m,
               std::int32_t no_entry, const Loops& loops)
    : loops_(&loops) {
  for (std::size_t first = 0; first < elements.size();) {
    std::size_t last = first;
    while (last < elements.size() && elements[last].kind == elements[first].kind && elements[last].law == elements[first].law) ++last;
    add_run(elements, first, last, laws[elements[first].law], places_m, no_entry);
    first = last;
  }
}

void Solids::add_run(const std::vector<SolidElement>& elements, std::size_t first, std::size_t last, const Law& law,
                     const std::vector<Vec3>& places_m, std::int32_t no_entry) {
  Run& run = runs_.emplace_back();
  const auto lanes = static_cast<std::size_t>(loops_->lanes), count = last - first;
  run.kind = elements[first].kind;
  run.law = law;
  run.first = static_cast<std::int64_t>(first);
  run.count = static_cast<std::int64_t>(count);
  const std::size_t blocks = (count + lanes - 1) / lanes;
  run.blocks = static_cast<std::int64_t>(blocks);
  const std::size_t nodes = count_nodes(run.kind), points = count_points(run.kind);
  const std::size_t shapes = run.kind == Kind::kCurvedT10 ? 4 : 1, width = 10 * shapes;
  const double scale = run.kind == Kind::kT4 ? 1.0 : kPointScale;
  run.shape.resize(blocks * width * lanes);
  if (law.is_damped()) {
    run.lag.resize(blocks * points * kStresses * lanes);
    run.spent.resize(blocks * lanes);
  }
  run.read.resize(blocks * nodes * lanes);
  run.write.resize(blocks * nodes * lanes);
  for (std::size_t place = 0; place < blocks * lanes; ++place) {
    const bool is_real = place < count;
    const SolidElement& element = elements[first + std::min(place, count - 1)];
    const std::size_t block = place / lanes, lane = place % lanes;
    std::array<Vec3, 10> x{};
    for (std::size_t a = 0; a < nodes; ++a) {
      x[a] = places_m[element.read[a]];
      run.read[(block * nodes + a) * lanes + lane] = 4 * element.read[a];
      run.write[(block * nodes + a) * lanes + lane] = 4 * (is_real ? element.write[a] : no_entry);
    }
    ElementShape shape;
    [[maybe_unused]] const bool ok = make_shape(run.kind, std::span(x.data(), nodes), shape);
    double* to = run.shape.data() + block * width * lanes + lane;
    for (std::size_t q = 0; q < shapes; ++q) {
      for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t j = 0; j < 3; ++j) to[(10 * q + 3 * k + j) * lanes] = scale * shape.gradient[q][k][j];
      to[(10 * q + 9) * lanes] = is_real ? shape.weight_m3[q] : 0.0;
    }
    if (is_real) block_lane_.push_back({static_cast<std::int32_t>(runs_.size() - 1), static_cast<std::int32_t>(place)});
  }
}

void Solids::add_forces(const StepWeights& weights, const Quad* u, const Quad* v, Quad* f) {
  for (Run& run : runs_) {
    const bool damped = run.law.is_damped();
    const AddForces add = run.kind == Kind::kT4    ? (damped ? loops_->t4_damped : loops_->t4)
                          : run.kind == Kind::kT10 ? (damped ? loops_->t10_damped : loops_->t10)
                                                   : (damped ? loops_->curved_damped : loops_->curved);
    BlockRun view = run.view();
    view.lag = run.lag.data();
    view.spent = run.spent.data();
    add(view, weights, u, v, f);
  }
}

void Solids::add_elastic_forces(const Quad* u, Quad* f) const {
  for (const Run& run : runs_) {
    const AddForces add = run.kind == Kind::kT4 ? loops_->t4 : run.kind == Kind::kT10 ? loops_->t10 : loops_->curved;
    add(run.view(), StepWeights{}, u, nullptr, f);
  }
}

void Solids::calc_state(const Quad* u, std::vector<double>& energy_j, std::vector<double>& least_det) const {
  energy_j.resize(block_lane_.size());
  least_det.resize(block_lane_.size());
  AlignedDoubles energy, least;
  for (const Run& run : runs_) {
    const std::size_t places = static_cast<std::size_t>(run.blocks) * static_cast<std::size_t>(loops_->lanes);
    energy.resize(places);
    least.resize(places);
    const CalcState calc = run.kind == Kind::kT4 ? loops_->t4_state : run.kind == Kind::kT10 ? loops_->t10_state : loops_->curved_state;
    calc(run.view(), u, energy.data(), least.data());
    const auto first = static_cast<std::ptrdiff_t>(run.first);
    std::copy_n(energy.data(), run.count, energy_j.begin() + first);
    std::copy_n(least.data(), run.count, least_det.begin() + first);
  }
}

std::vector<double> Solids::list_spent() const {
  std::vector<double> spent(block_lane_.size(), 0.0);
  for (const Run& run : runs_)
    if (run.law.is_damped()) std::copy_n(run.spent.data(), run.count, spent.begin() + static_cast<std::ptrdiff_t>(run.first));
  return spent;
}

void Solids::forget_spent() {
  for (Run& run : runs_) std::fill_n(run.spent.data(), run.spent.size(), 0.0);
}

void Solids::save_state(std::vector<double>& state) const {
  const std::size_t lanes = loops_->lanes;
  for (const Place& at : block_lane_) {
    const Run& run = runs_[at.run];
    const std::size_t begin = state.size();
    state.resize(begin + kStateWidth, 0.0);
    if (!run.law.is_damped()) continue;
    const auto place = static_cast<std::size_t>(at.place), width = static_cast<std::size_t>(count_points(run.kind)) * kStresses;
    state[begin] = run.spent.data()[place];
    for (std::size_t i = 0; i < width; ++i) state[begin + 1 + i] = run.lag.data()[(place / lanes * width + i) * lanes + place % lanes];
  }
}

void Solids::load_state(std::span<const double> state) {
  const std::size_t lanes = loops_->lanes;
  for (std::size_t e = 0; e < block_lane_.size(); ++e) {
    Run& run = runs_[block_lane_[e].run];
    if (!run.law.is_damped()) continue;
    const std::size_t place = block_lane_[e].place;
    const std::size_t width = static_cast<std::size_t>(count_points(run.kind)) * kStresses;
    run.spent.data()[place] = state[e * kStateWidth];
    for (std::size_t i = 0; i < width; ++i)
      run.lag.data()[(place / lanes * width + i) * lanes + place % lanes] = state[e * kStateWidth + 1 + i];
  }
}

}  // namespace carillon::transient
