// Method: rank 0 sends each rank its surface rows and distributes the outer triangles; values at other ranks' rows are exchanged once per
//   block of modes. A block is read from the columns once: its largest components give the steps (maximum over the ranks), its flow through
//   the triangles the gains (sum over the ranks). Rank 0 then receives the steps from one rank after the other.
#include "precompute/run/io/surface_modes.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "precompute/comm/halo_exchange.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::io {
namespace {

constexpr int kStepsTag = 12;
constexpr std::size_t kBlock = 16;                       // modes at a time: a row fills whole cache lines
constexpr std::size_t kMessage = std::size_t{32} << 20;  // bytes of steps per message

/// Triangle of rows: corners as rows of the shapes (-1: at rest), twice the area times the normal.
struct Panel {
  std::array<std::int32_t, 3> row;
  Vec3 normal;
};

class SurfaceWork {
 public:
  SurfaceWork(const comm::Communicator& comm, Mat shapes, const Surface& surface);
  SurfaceModes calc(std::span<const double> omega_rad_s);

 private:
  void deal(const Surface& surface);
  void find_halo();
  void load(std::size_t mode, std::size_t count);
  void add_flow(std::size_t mode, std::size_t count);
  void quantise(std::size_t mode, std::size_t count);
  std::vector<std::int16_t> collect();

  comm::Communicator comm_;
  Mat shapes_;
  std::size_t modes_ = 0;
  comm::IndexPartition owners_;  // of the rows of nodes

  std::vector<std::size_t> vertex_;  // rank 0: (free surface vertices) by ascending row, hence by rank
  std::vector<int> vertex_count_;    // rank 0: per rank
  std::size_t vertices_ = 0;         // rank 0: V, fixed ones included
  double area_m2_ = 0.0;

  std::vector<std::int32_t> rows_;              // own surface rows, ascending, then the panels' rows of other ranks
  std::size_t own_ = 0;                         // of rows_
  std::vector<Panel> panels_;                   // their rows index rows_
  comm::HaloExchange halo_;                     // values at the rows of others
  std::vector<double> values_;                  // (rows_, 3, kBlock)
  std::vector<double> largest_, flow_, scale_;  // (m)
  std::vector<std::int16_t> steps_;             // (own_, m, 3)
};

SurfaceWork::SurfaceWork(const comm::Communicator& comm, Mat shapes, const Surface& surface)
    : comm_(comm), shapes_(shapes), vertices_(surface.row.size()) {
  PetscInt modes = 0, own_rows = 0;
  petsc::check(MatGetSize(shapes, nullptr, &modes));
  petsc::check(MatGetLocalSize(shapes, &own_rows, nullptr));
  modes_ = modes;
  owners_ = comm::IndexPartition(comm, own_rows / 3);
  deal(surface);
  find_halo();
  comm_.agree([&] {
    values_.resize(rows_.size() * 3 * kBlock);
    steps_.resize(own_ * modes_ * 3);
    largest_.assign(modes_, 0.0);
    flow_.assign(modes_, 0.0);
    scale_.assign(modes_, 0.0);
    halo_.reserve(3 * kBlock * sizeof(double));
  });
}

/// Rank 0 sends every rank its rows of the surface and the panels whose first moving corner it owns.
void SurfaceWork::deal(const Surface& surface) {
  const auto list_rows = [&] {
    vertex_count_.assign(comm_.size(), 0);
    std::vector<std::int32_t> rows;
    for (std::size_t v = 0; comm_.is_root() && v < surface.row.size(); ++v)
      if (surface.row[v] >= 0) vertex_.push_back(v);
    std::sort(vertex_.begin(), vertex_.end(), [&](std::size_t a, std::size_t b) { return surface.row[a] < surface.row[b]; });
    for (const std::size_t v : vertex_) {
      rows.push_back(surface.row[v]);
      ++vertex_count_[owners_.find_owner(rows.back())];
    }
    return rows;
  };
  const auto find_moving = [](const Panel& panel) {
    return *std::find_if(panel.row.begin(), panel.row.end(), [](std::int32_t row) { return row >= 0; });
  };
  const auto list_panels = [&] {
    std::vector<Panel> panels;
    if (!comm_.is_root()) return panels;
    for (const Triangle& triangle : bank::find_outer_triangles(surface.vertices_m, surface.triangles)) {
      Panel panel{{}, bank::calc_normal(surface.vertices_m, triangle)};
      area_m2_ += std::hypot(panel.normal[0], panel.normal[1], panel.normal[2]) / 2;
      for (int i = 0; i < 3; ++i) panel.row[i] = surface.row[triangle[i]];
      if (std::any_of(panel.row.begin(), panel.row.end(), [](std::int32_t row) { return row >= 0; })) panels.push_back(panel);
    }
    return panels;
  };
  rows_ = comm::all_to_all(comm_, list_rows, [&](std::int32_t row) { return owners_.find_owner(row); }).items;
  own_ = rows_.size();
  panels_ = comm::all_to_all(comm_, list_panels, [&](const Panel& panel) { return owners_.find_owner(find_moving(panel)); }).items;
  area_m2_ = comm_.broadcast(area_m2_);
}

/// Finds the panels' rows of other ranks, and converts rows to indices.
void SurfaceWork::find_halo() {
  const auto find_place = [&](std::int32_t row) {
    const auto begin = owners_.is_own(row) ? rows_.begin() : rows_.begin() + static_cast<std::ptrdiff_t>(own_);
    const auto end = owners_.is_own(row) ? rows_.begin() + static_cast<std::ptrdiff_t>(own_) : rows_.end();
    return static_cast<std::int32_t>(std::lower_bound(begin, end, row) - rows_.begin());
  };
  const auto halo = comm_.agree([&] {
    comm::Halo others;
    for (const Panel& panel : panels_)
      for (const std::int32_t row : panel.row)
        if (row >= 0 && !owners_.is_own(row)) others.number.push_back(row);
    std::sort(others.number.begin(), others.number.end());
    others.number.erase(std::unique(others.number.begin(), others.number.end()), others.number.end());
    for (const std::int32_t row : others.number) {
      others.owner.push_back(owners_.find_owner(row));
      others.place.push_back(static_cast<std::int32_t>(rows_.size()));
      rows_.push_back(row);
    }
    for (Panel& panel : panels_)
      for (std::int32_t& row : panel.row)
        if (row >= 0) row = find_place(row);
    return others;
  });
  halo_ = comm::HaloExchange(comm_, halo, find_place);
}

/// Copies `count` columns from `mode` on at the own rows and updates their largest components.
void SurfaceWork::load(std::size_t mode, std::size_t count) {
  PetscInt leading = 0;
  const double* array = nullptr;
  petsc::check(MatDenseGetLDA(shapes_, &leading));
  petsc::check(MatDenseGetArrayRead(shapes_, &array));
  const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(mode) * leading - 3 * static_cast<std::ptrdiff_t>(owners_.own_begin());
  for (std::size_t i = 0; i < own_; ++i)
    for (int d = 0; d < 3; ++d) {
      const double* from = array + first + 3 * static_cast<std::ptrdiff_t>(rows_[i]) + d;
      double* to = &values_[(3 * i + d) * kBlock];
      for (std::size_t k = 0; k < count; ++k) to[k] = from[k * static_cast<std::size_t>(leading)];
    }
  petsc::check(MatDenseRestoreArrayRead(shapes_, &array));
  for (std::size_t i = 0; i < 3 * own_; ++i)
    for (std::size_t k = 0; k < count; ++k) {
      const double size = std::abs(values_[i * kBlock + k]);
      double& largest = largest_[mode + k];
      largest = std::isnan(largest) || size <= largest ? largest : size;  // keeps a NaN
    }
}

/// Adds |integral phi . n dA| of every panel.
void SurfaceWork::add_flow(std::size_t mode, std::size_t count) {
  std::array<double, kBlock> sum{};
  for (const Panel& panel : panels_) {
    std::array<double, kBlock> through{};  // 3 phi . n of the middle, times twice the area
    for (const std::int32_t row : panel.row) {
      if (row < 0) continue;
      const double* phi = &values_[3 * kBlock * row];
      for (int d = 0; d < 3; ++d)
        for (std::size_t k = 0; k < kBlock; ++k) through[k] += panel.normal[d] * phi[d * kBlock + k];
    }
    for (std::size_t k = 0; k < kBlock; ++k) sum[k] += std::abs(through[k]);
  }
  for (std::size_t k = 0; k < count; ++k) flow_[mode + k] = sum[k] / 6;
}

void SurfaceWork::quantise(std::size_t mode, std::size_t count) {
  for (std::size_t i = 0; i < own_; ++i)
    for (int d = 0; d < 3; ++d) {
      const double* from = &values_[(3 * i + d) * kBlock];
      std::int16_t* to = &steps_[(i * modes_ + mode) * 3 + d];
      for (std::size_t k = 0; k < count; ++k) to[3 * k] = bank::find_step(from[k], scale_[mode + k]);
    }
}

/// Rank 0 orders the steps of all ranks by its vertices; fixed ones are 0.
std::vector<std::int16_t> SurfaceWork::collect() {
  const std::size_t row = modes_ * 3;
  const std::size_t rows_at_a_time = std::max<std::size_t>(1, kMessage / (row * sizeof(std::int16_t)));
  std::vector<std::int16_t> shape, arrived;
  comm_.agree([&] {
    if (!comm_.is_root()) return;
    shape.assign(vertices_ * row, 0);
    arrived.resize(comm_.size() > 1 ? std::min(rows_at_a_time, vertex_.size()) * row : 0);
  });
  if (!comm_.is_root()) {
    for (std::size_t i = 0; i < own_; i += rows_at_a_time)
      MPI_Send(&steps_[i * row], static_cast<int>(std::min(rows_at_a_time, own_ - i) * row), MPI_INT16_T, 0, kStepsTag, comm_);
    return {};
  }
  for (std::size_t i = 0; i < own_; ++i) std::copy_n(steps_.data() + i * row, row, shape.data() + vertex_[i] * row);
  steps_ = {};
  std::size_t at = own_;
  for (int from = 1; from < comm_.size(); ++from) {
    const std::size_t theirs = vertex_count_[from];
    for (std::size_t done = 0; done < theirs; done += rows_at_a_time) {
      const std::size_t now = std::min(rows_at_a_time, theirs - done);
      MPI_Recv(arrived.data(), static_cast<int>(now * row), MPI_INT16_T, from, kStepsTag, comm_, MPI_STATUS_IGNORE);
      for (std::size_t i = 0; i < now; ++i) std::copy_n(arrived.data() + i * row, row, shape.data() + vertex_[at++] * row);
    }
  }
  return shape;
}

SurfaceModes SurfaceWork::calc(std::span<const double> omega_rad_s) {
  for (std::size_t mode = 0; mode < modes_; mode += kBlock) {
    const std::size_t count = std::min(kBlock, modes_ - mode);
    load(mode, count);
    halo_.copy_to_halo(values_.data(), 3 * kBlock);
    add_flow(mode, count);
    for (std::size_t k = mode; k < mode + count; ++k)
      if (!std::isfinite(largest_[k])) largest_[k] = HUGE_VAL;  // MPI_MAX may lose a NaN
    comm_.max(std::span(largest_).subspan(mode, count));
    for (std::size_t k = mode; k < mode + count; ++k) {
      if (largest_[k] == HUGE_VAL) throw SolveError(fmt::format("The shape of mode {} is not finite.", k));
      scale_[k] = bank::calc_shape_scale(largest_[k]);
    }
    quantise(mode, count);
  }
  comm_.sum(flow_);
  SurfaceModes modes;
  for (std::size_t k = 0; k < modes_; ++k) modes.radiation_gain.push_back(bank::calc_radiation_gain(omega_rad_s[k], flow_[k], area_m2_));
  modes.shape_scale = scale_;
  values_ = {};
  modes.shape = collect();
  return modes;
}

}  // namespace

SurfaceModes calc_surface_modes(const comm::Communicator& comm, Mat shapes, std::span<const double> omega_rad_s, const Surface& surface) {
  if (shapes == nullptr) return {};
  return SurfaceWork(comm, shapes, surface).calc(omega_rad_s);
}

}  // namespace carillon::io
