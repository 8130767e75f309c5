// Method: rank 0 tells each rank which of its rows lie on the surface and hands out the outer triangles; what a triangle needs of another
//   rank's rows is fetched once per block of modes. A block is read from the columns once: its largest components give the steps (maximum
//   over the ranks), its flow through the triangles the gains (sum over the ranks). Rank 0 then takes the steps, one rank after the other.
// Source: none needed; the flow is that of radiation.cpp. Deviations: none.
#include "precompute/io/surface_modes.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "precompute/petsc/session.hpp"

namespace carillon::io {
namespace {

constexpr int kStepsTag = 12;
constexpr std::size_t kBlock = 16;                       // modes at a time: a row of them fills whole cache lines
constexpr std::size_t kMessage = std::size_t{32} << 20;  // steps of one message

/// Triangle of rows: corners as rows of the shapes (-1: at rest), twice the area times the normal.
struct Panel {
  std::array<std::int32_t, 3> row;
  Vec3 normal;
};

template <class T>
std::vector<T> scatter(MPI_Comm comm, const std::vector<T>& items, const std::vector<int>& count) {
  int mine = 0;
  MPI_Scatter(count.data(), 1, MPI_INT, &mine, 1, MPI_INT, 0, comm);
  std::vector<T> part(static_cast<std::size_t>(mine));
  std::vector<int> at(count.size() + 1, 0);
  std::partial_sum(count.begin(), count.end(), at.begin() + 1);
  MPI_Datatype type = MPI_DATATYPE_NULL;
  MPI_Type_contiguous(static_cast<int>(sizeof(T)), MPI_BYTE, &type);
  MPI_Type_commit(&type);
  MPI_Scatterv(items.data(), count.data(), at.data(), type, part.data(), mine, type, 0, comm);
  MPI_Type_free(&type);
  return part;
}

class SurfaceWork {
 public:
  SurfaceWork(MPI_Comm comm, Mat shapes, const Surface& surface);
  SurfaceModes calc(std::span<const double> omega_rad_s);

 private:
  void deal(const Surface& surface);
  void plan_exchange();
  void load(std::size_t mode, std::size_t count);
  void exchange();
  void add_flow(std::size_t mode, std::size_t count);
  void quantise(std::size_t mode, std::size_t count);
  std::vector<std::int16_t> collect();
  int find_owner(std::int32_t row) const {
    return static_cast<int>(std::upper_bound(first_row_.begin(), first_row_.end(), row) - first_row_.begin()) - 1;
  }

  MPI_Comm comm_;
  int rank_ = 0;
  int ranks_ = 1;
  Mat shapes_;
  std::size_t modes_ = 0;
  std::vector<std::int32_t> first_row_;  // (ranks + 1) nodes

  std::vector<std::size_t> vertex_;  // rank 0: (free surface vertices) by ascending row, which is by rank
  std::vector<int> vertex_count_;    // rank 0: of each rank
  std::size_t vertices_ = 0;         // rank 0: V, held ones included
  double area_m2_ = 0.0;

  std::vector<std::int32_t> rows_;              // own rows on the surface, ascending, then rows of others that panels need
  std::size_t own_ = 0;                         // of rows_
  std::vector<Panel> panels_;                   // their rows index rows_
  std::vector<int> send_count_, get_count_;     // rows of the exchange, by rank
  std::vector<std::int32_t> send_;              // indices into rows_, by receiver
  std::vector<double> values_;                  // (rows_, 3, kBlock)
  std::vector<double> largest_, flow_, scale_;  // (m)
  std::vector<std::int16_t> steps_;             // (own_, m, 3)
};

SurfaceWork::SurfaceWork(MPI_Comm comm, Mat shapes, const Surface& surface) : comm_(comm), shapes_(shapes), vertices_(surface.row.size()) {
  MPI_Comm_rank(comm, &rank_);
  MPI_Comm_size(comm, &ranks_);
  PetscInt modes = 0;
  const PetscInt* range = nullptr;
  petsc::check(MatGetSize(shapes, nullptr, &modes));
  petsc::check(MatGetOwnershipRanges(shapes, &range));
  modes_ = static_cast<std::size_t>(modes);
  for (int r = 0; r <= ranks_; ++r) first_row_.push_back(static_cast<std::int32_t>(range[r] / 3));
  deal(surface);
  plan_exchange();
  petsc::run_agreed(comm_, [&] {
    values_.resize(rows_.size() * 3 * kBlock);
    steps_.resize(own_ * modes_ * 3);
    largest_.assign(modes_, 0.0);
    flow_.assign(modes_, 0.0);
    scale_.assign(modes_, 0.0);
  });
}

/// Rank 0 hands every rank its rows of the surface and the panels whose first moving corner it owns.
void SurfaceWork::deal(const Surface& surface) {
  std::vector<std::int32_t> rows;
  std::vector<Panel> panels;
  std::vector<int> panel_count;
  petsc::run_agreed(comm_, [&] {
    if (rank_ != 0) return;
    vertex_count_.assign(static_cast<std::size_t>(ranks_), 0);
    panel_count = vertex_count_;
    for (std::size_t v = 0; v < surface.row.size(); ++v)
      if (surface.row[v] >= 0) vertex_.push_back(v);
    std::sort(vertex_.begin(), vertex_.end(), [&](std::size_t a, std::size_t b) { return surface.row[a] < surface.row[b]; });
    for (const std::size_t v : vertex_) {
      rows.push_back(surface.row[v]);
      ++vertex_count_[static_cast<std::size_t>(find_owner(rows.back()))];
    }
    std::vector<std::vector<Panel>> dealt(static_cast<std::size_t>(ranks_));
    for (const Triangle& triangle : find_outer_triangles(surface.vertices_m, surface.triangles)) {
      Panel panel{{}, calc_normal(surface.vertices_m, triangle)};
      area_m2_ += std::hypot(panel.normal[0], panel.normal[1], panel.normal[2]) / 2;
      for (int i = 0; i < 3; ++i) panel.row[i] = surface.row[triangle[i]];
      const auto moving = std::find_if(panel.row.begin(), panel.row.end(), [](std::int32_t row) { return row >= 0; });
      if (moving != panel.row.end()) dealt[static_cast<std::size_t>(find_owner(*moving))].push_back(panel);
    }
    for (std::size_t r = 0; r < dealt.size(); ++r) {
      panel_count[r] = static_cast<int>(dealt[r].size());
      panels.insert(panels.end(), dealt[r].begin(), dealt[r].end());
    }
  });
  rows_ = scatter(comm_, rows, vertex_count_);
  own_ = rows_.size();
  panels_ = scatter(comm_, panels, panel_count);
  MPI_Bcast(&area_m2_, 1, MPI_DOUBLE, 0, comm_);
}

/// Finds the rows of others that panels need, tells their owners, and turns rows into indices.
void SurfaceWork::plan_exchange() {
  const auto ranks = static_cast<std::size_t>(ranks_);
  const auto find_own = [&](std::int32_t row) { return std::lower_bound(rows_.begin(), rows_.begin() + own_, row) - rows_.begin(); };
  const auto is_own = [&](std::int32_t row) { return row >= first_row_[rank_] && row < first_row_[rank_ + 1]; };
  std::vector<std::int32_t> asked;
  petsc::run_agreed(comm_, [&] {
    std::vector<std::int32_t> others;
    for (const Panel& panel : panels_)
      for (const std::int32_t row : panel.row)
        if (row >= 0 && !is_own(row)) others.push_back(row);
    std::sort(others.begin(), others.end());
    others.erase(std::unique(others.begin(), others.end()), others.end());
    get_count_.assign(ranks, 0);
    send_count_.assign(ranks, 0);
    for (const std::int32_t row : others) ++get_count_[static_cast<std::size_t>(find_owner(row))];
    rows_.insert(rows_.end(), others.begin(), others.end());
    for (Panel& panel : panels_)
      for (std::int32_t& row : panel.row) {
        if (row < 0) continue;
        row = static_cast<std::int32_t>(is_own(row) ? find_own(row)
                                                    : std::lower_bound(rows_.begin() + own_, rows_.end(), row) - rows_.begin());
      }
  });
  MPI_Alltoall(get_count_.data(), 1, MPI_INT, send_count_.data(), 1, MPI_INT, comm_);
  std::vector<int> get_at(ranks + 1, 0), send_at(ranks + 1, 0);
  std::partial_sum(get_count_.begin(), get_count_.end(), get_at.begin() + 1);
  std::partial_sum(send_count_.begin(), send_count_.end(), send_at.begin() + 1);
  petsc::run_agreed(comm_, [&] { send_.resize(static_cast<std::size_t>(send_at.back())); });
  MPI_Alltoallv(rows_.data() + own_, get_count_.data(), get_at.data(), MPI_INT32_T, send_.data(), send_count_.data(), send_at.data(),
                MPI_INT32_T, comm_);
  for (std::int32_t& row : send_) row = static_cast<std::int32_t>(find_own(row));
}

/// Copies `count` columns from `mode` on at the own rows and keeps their largest components.
void SurfaceWork::load(std::size_t mode, std::size_t count) {
  PetscInt leading = 0;
  const double* array = nullptr;
  petsc::check(MatDenseGetLDA(shapes_, &leading));
  petsc::check(MatDenseGetArrayRead(shapes_, &array));
  const double* columns = array + mode * static_cast<std::size_t>(leading) - 3 * static_cast<std::ptrdiff_t>(first_row_[rank_]);
  for (std::size_t i = 0; i < own_; ++i)
    for (int d = 0; d < 3; ++d) {
      const double* from = columns + 3 * static_cast<std::size_t>(rows_[i]) + d;
      double* to = &values_[(3 * i + d) * kBlock];
      for (std::size_t k = 0; k < count; ++k) to[k] = from[k * static_cast<std::size_t>(leading)];
    }
  petsc::check(MatDenseRestoreArrayRead(shapes_, &array));
  for (std::size_t i = 0; i < 3 * own_; ++i)
    for (std::size_t k = 0; k < count; ++k) {
      const double size = std::abs(values_[i * kBlock + k]);
      double& largest = largest_[mode + k];
      largest = std::isnan(largest) || size <= largest ? largest : size;  // a NaN comes in and stays
    }
}

void SurfaceWork::exchange() {
  if (ranks_ == 1) return;
  constexpr int kRow = 3 * static_cast<int>(kBlock);
  std::vector<double> leaving(send_.size() * kRow);
  for (std::size_t i = 0; i < send_.size(); ++i) std::copy_n(&values_[static_cast<std::size_t>(send_[i]) * kRow], kRow, &leaving[i * kRow]);
  MPI_Datatype row = MPI_DATATYPE_NULL;
  MPI_Type_contiguous(kRow, MPI_DOUBLE, &row);
  MPI_Type_commit(&row);
  const auto ranks = static_cast<std::size_t>(ranks_);
  std::vector<int> get_at(ranks + 1, 0), send_at(ranks + 1, 0);
  std::partial_sum(get_count_.begin(), get_count_.end(), get_at.begin() + 1);
  std::partial_sum(send_count_.begin(), send_count_.end(), send_at.begin() + 1);
  MPI_Alltoallv(leaving.data(), send_count_.data(), send_at.data(), row, values_.data() + own_ * kRow, get_count_.data(), get_at.data(),
                row, comm_);
  MPI_Type_free(&row);
}

/// Adds |integral phi . n dA| of every panel.
void SurfaceWork::add_flow(std::size_t mode, std::size_t count) {
  std::array<double, kBlock> sum{};
  for (const Panel& panel : panels_) {
    std::array<double, kBlock> through{};  // 3 phi . n of the middle, times twice the area
    for (const std::int32_t row : panel.row) {
      if (row < 0) continue;
      const double* phi = &values_[static_cast<std::size_t>(row) * 3 * kBlock];
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

/// Rank 0 puts the steps of all ranks in the order of its vertices; held ones rest.
std::vector<std::int16_t> SurfaceWork::collect() {
  const std::size_t row = modes_ * 3;
  const std::size_t rows_at_a_time = std::max<std::size_t>(1, kMessage / row);
  std::vector<std::int16_t> shape, arrived;
  petsc::run_agreed(comm_, [&] {
    if (rank_ != 0) return;
    shape.assign(vertices_ * row, 0);
    arrived.resize(ranks_ > 1 ? std::min(rows_at_a_time, vertex_.size()) * row : 0);
  });
  if (rank_ != 0) {
    for (std::size_t i = 0; i < own_; i += rows_at_a_time)
      MPI_Send(&steps_[i * row], static_cast<int>(std::min(rows_at_a_time, own_ - i) * row), MPI_INT16_T, 0, kStepsTag, comm_);
    return {};
  }
  for (std::size_t i = 0; i < own_; ++i) std::copy_n(&steps_[i * row], row, &shape[vertex_[i] * row]);
  steps_ = {};
  std::size_t at = own_;
  for (int from = 1; from < ranks_; ++from) {
    const auto theirs = static_cast<std::size_t>(vertex_count_[static_cast<std::size_t>(from)]);
    for (std::size_t done = 0; done < theirs; done += rows_at_a_time) {
      const std::size_t now = std::min(rows_at_a_time, theirs - done);
      MPI_Recv(arrived.data(), static_cast<int>(now * row), MPI_INT16_T, from, kStepsTag, comm_, MPI_STATUS_IGNORE);
      for (std::size_t i = 0; i < now; ++i) std::copy_n(&arrived[i * row], row, &shape[vertex_[at++] * row]);
    }
  }
  return shape;
}

SurfaceModes SurfaceWork::calc(std::span<const double> omega_rad_s) {
  for (std::size_t mode = 0; mode < modes_; mode += kBlock) {
    const std::size_t count = std::min(kBlock, modes_ - mode);
    load(mode, count);
    exchange();
    add_flow(mode, count);
    for (std::size_t k = mode; k < mode + count; ++k)
      if (!std::isfinite(largest_[k])) largest_[k] = HUGE_VAL;  // MPI_MAX may lose a NaN
    MPI_Allreduce(MPI_IN_PLACE, &largest_[mode], static_cast<int>(count), MPI_DOUBLE, MPI_MAX, comm_);
    for (std::size_t k = mode; k < mode + count; ++k) {
      if (largest_[k] == HUGE_VAL) throw SolveError(fmt::format("The shape of mode {} is not finite.", k));
      scale_[k] = bank::calc_shape_scale(largest_[k]);
    }
    quantise(mode, count);
  }
  MPI_Allreduce(MPI_IN_PLACE, flow_.data(), static_cast<int>(modes_), MPI_DOUBLE, MPI_SUM, comm_);
  SurfaceModes modes;
  for (std::size_t k = 0; k < modes_; ++k) modes.radiation_gain.push_back(calc_radiation_gain(omega_rad_s[k], flow_[k], area_m2_));
  modes.shape_scale = scale_;
  values_ = {};
  modes.shape = collect();
  return modes;
}

}  // namespace

SurfaceModes calc_surface_modes(MPI_Comm comm, Mat shapes, std::span<const double> omega_rad_s, const Surface& surface) {
  if (shapes == nullptr) return {};
  return SurfaceWork(comm, shapes, surface).calc(omega_rad_s);
}

}  // namespace carillon::io
