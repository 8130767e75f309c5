// Method: principal axes of the surface. Long bodies: slices with fitted rigid motions; a dominant component is bending, torsion or
//   longitudinal motion, its sign changes between slices are nodes. Round bodies: Fourier series about the axis, ring by ring; a dominant
//   order n is the number of nodal diameters. Flat bodies: out-of-plane motion on a grid of cells; a dominant separable function (singular
//   value) has the nodal lines of its factors. Otherwise the kind is unknown.
// Source: Fletcher and Rossing, The Physics of Musical Instruments, ch. 2, 3 and 21.
// Deviations: weighted by surface area instead of mass.
#include "runtime/bank/kinds.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>

#include "runtime/bank/surface.hpp"

namespace carillon::bank {
namespace {

constexpr double kLong = 2.5, kFlat = 0.25;                          // length / width; thickness / width
constexpr double kSquareTolerance = 0.03, kSphereTolerance = 0.003;  // relative difference of second moments
constexpr double kRoundTolerance = 0.02;                             // limit of the area's Fourier coefficients about the axis
constexpr double kRigidSlices = 0.9, kOneKind = 0.8, kOneOrder = 0.6;
constexpr double kOnePlane = 0.9, kProduct = 0.85;
constexpr double kMinBreathingFlow = 0.8;  // squared volume flow relative to uniform motion of equal energy
constexpr double kZeroLevel = 0.03;        // relative to the largest value; treated as 0 below
constexpr int kMaxOrder = 12, kCells = 12, kRings = 8;
constexpr std::size_t kMinSlicePoints = 8;  // minimum number of vertices of a slice

double square(double x) { return x * x; }

/// Eigenvalues of a symmetric matrix, descending, and right-handed unit eigenvectors (rows), by Jacobi rotations.
struct Axes {
  Vec3 moment{};
  Mat3 axis{};
};

Axes find_axes(Mat3 m) {
  Mat3 v{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};  // rows
  for (int sweep = 0; sweep < 30; ++sweep)
    for (const auto& [p, q] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
      if (m[p][q] == 0.0) continue;
      const double angle = 0.5 * std::atan2(2.0 * m[p][q], m[q][q] - m[p][p]), c = std::cos(angle), s = std::sin(angle);
      for (int k = 0; k < 3; ++k) {
        const double a = m[k][p], b = m[k][q];
        m[k][p] = c * a - s * b;
        m[k][q] = s * a + c * b;
      }
      for (int k = 0; k < 3; ++k) {
        const double a = m[p][k], b = m[q][k], x = v[p][k], y = v[q][k];
        m[p][k] = c * a - s * b;
        m[q][k] = s * a + c * b;
        v[p][k] = c * x - s * y;
        v[q][k] = s * x + c * y;
      }
    }
  std::array<int, 3> order{0, 1, 2};
  std::sort(order.begin(), order.end(), [&](int a, int b) { return m[a][a] > m[b][b]; });
  Axes axes;
  for (int k = 0; k < 3; ++k) {
    axes.moment[k] = m[order[k]][order[k]];
    axes.axis[k] = v[order[k]];
  }
  if (calc_det(axes.axis[0], axes.axis[1], axes.axis[2]) < 0.0) axes.axis[2] = -1.0 * axes.axis[2];
  return axes;
}

/// Surface in principal axes, longest first.
struct Frame {
  Axes axes;
  std::vector<Vec3> place;     // (V) [m]
  std::vector<double> area;    // (V) a third of the adjacent triangles
  std::array<Vec3, 2> extent;  // bounds of `place`
  double all_area = 0.0;

  double size(int k) const { return extent[1][k] - extent[0][k]; }
  /// Index of the part that contains p, of `count` equal parts of the extent along axis k.
  std::size_t find_part(const Vec3& p, int k, int count) const {
    const double along = (p[k] - extent[0][k]) / std::max(size(k), 1e-300);
    return std::clamp(static_cast<int>(along * count), 0, count - 1);
  }
};

/// Aligns axes 0 and 1, arbitrary for equal second moments, with the sides of a square.
void align(Frame& frame) {
  std::complex<double> fourth = 0.0;
  for (std::size_t v = 0; v < frame.place.size(); ++v)
    fourth += frame.area[v] * std::pow(std::complex<double>(frame.place[v][0], frame.place[v][1]), 4);
  const double angle = std::arg(-fourth) / 4.0, c = std::cos(angle), s = std::sin(angle);
  const Vec3 a = frame.axes.axis[0], b = frame.axes.axis[1];
  frame.axes.axis[0] = c * a + s * b;
  frame.axes.axis[1] = c * b - s * a;
  for (Vec3& p : frame.place) p = {c * p[0] + s * p[1], c * p[1] - s * p[0], p[2]};
}

Frame make_frame(const Bank& bank) {
  Frame frame;
  frame.area.assign(bank.vertex_count(), 0.0);
  for (const Triangle& t : bank.triangles)
    for (const std::int32_t v : t) frame.area[v] += norm(calc_normal(bank.vertices_m, t)) / 6.0;
  Vec3 centre{};
  for (std::size_t v = 0; v < frame.area.size(); ++v) {
    frame.all_area += frame.area[v];
    centre = centre + frame.area[v] * bank.vertices_m[v];
  }
  centre = (1.0 / frame.all_area) * centre;
  Mat3 moment{};
  for (std::size_t v = 0; v < frame.area.size(); ++v) {
    const Vec3 p = bank.vertices_m[v] - centre;
    for (int r = 0; r < 3; ++r) moment[r] = moment[r] + (frame.area[v] * p[r]) * p;
  }
  frame.axes = find_axes(moment);
  for (const Vec3& p : bank.vertices_m) frame.place.push_back(frame.axes.axis * (p - centre));
  if (frame.axes.moment[0] < (1.0 + kSquareTolerance) * frame.axes.moment[1]) align(frame);
  frame.extent = find_extent(frame.place);
  return frame;
}

/// Number of sign changes, ignoring values near 0.
int count_nodes(const std::vector<double>& values) {
  double largest = 0.0, last = 0.0;
  for (const double x : values) largest = std::max(largest, std::abs(x));
  int nodes = 0;
  for (const double x : values) {
    if (std::abs(x) <= kZeroLevel * largest) continue;
    if (x * last < 0.0) ++nodes;
    last = x;
  }
  return nodes;
}

/// Mode shape in the axes of the frame.
class Shape {
 public:
  Shape(const Bank& bank, const Frame& frame, std::size_t mode) : motion_(bank.vertex_count()) {
    for (std::size_t v = 0; v < motion_.size(); ++v) {
      motion_[v] = frame.axes.axis * bank.shape_at(v, mode);
      energy_ += frame.area[v] * dot(motion_[v], motion_[v]);
    }
  }
  const Vec3& operator[](std::size_t v) const { return motion_[v]; }
  double energy() const { return energy_; }

 private:
  std::vector<Vec3> motion_;
  double energy_ = 0.0;
};

/// Slices of a long body, each with a fitted rigid motion.
class Slices {
 public:
  explicit Slices(const Frame& frame) : frame_(frame) {
    constexpr int kMost = 48;
    const int count = std::clamp(static_cast<int>(frame.place.size() / (3 * kMinSlicePoints)), 1, kMost);
    std::vector<std::vector<std::size_t>> parts(count);
    for (std::size_t v = 0; v < frame.place.size(); ++v) parts[frame.find_part(frame.place[v], 0, count)].push_back(v);
    for (std::vector<std::size_t>& part : parts)
      if (part.size() >= kMinSlicePoints) slices_.push_back(make_slice(std::move(part)));
  }

  ModeKind find(const Shape& shape) const {
    std::array<std::vector<double>, 4> along;  // by slice: translations along axes 0, 1, 2, rotation about axis 0
    std::array<double, 4> energy{};
    double across = 0.0;  // sum of t1 t2
    for (const Slice& slice : slices_) {
      Vec3 mean{}, turn{};
      for (const std::size_t v : slice.vertices) mean = mean + (frame_.area[v] / slice.area) * shape[v];
      for (const std::size_t v : slice.vertices) turn = turn + frame_.area[v] * cross(frame_.place[v] - slice.centre, shape[v]);
      const Vec3 angle = slice.by_moment * turn;
      for (int k = 0; k < 3; ++k) {
        along[k].push_back(mean[k]);
        energy[k] += slice.area * square(mean[k]);
      }
      along[3].push_back(angle[0]);
      energy[3] += angle[0] * turn[0];
      energy[1] += angle[2] * turn[2];  // tilt of slices: part of bending
      energy[2] += angle[1] * turn[1];
      across += slice.area * mean[1] * mean[2];
    }
    const double all = energy[0] + energy[1] + energy[2] + energy[3];
    if (!(all > kRigidSlices * shape.energy())) return {};
    const bool has_widths = frame_.axes.moment[1] > (1.0 + kSquareTolerance) * frame_.axes.moment[2];
    const auto is_most = [&](double part) { return part > kOneKind * all; };
    if (is_most(energy[0])) return finish(MotionKind::kLongitudinal, along[0]);
    if (is_most(energy[3])) return finish(MotionKind::kTorsion, along[3]);
    if (has_widths && is_most(energy[1])) return finish(MotionKind::kLateralBending, along[1]);
    if (has_widths && is_most(energy[2])) return finish(MotionKind::kBending, along[2]);
    if (has_widths || !is_most(energy[1] + energy[2])) return {};
    const double angle = 0.5 * std::atan2(2.0 * across, energy[1] - energy[2]);
    for (std::size_t s = 0; s < along[1].size(); ++s) along[1][s] = std::cos(angle) * along[1][s] + std::sin(angle) * along[2][s];
    return finish(MotionKind::kBending, along[1]);
  }

 private:
  struct Slice {
    std::vector<std::size_t> vertices;
    double area = 0.0;
    Vec3 centre{};
    Mat3 by_moment{};  // inverse moments of area: angular momentum to rotation
  };

  Slice make_slice(std::vector<std::size_t> vertices) const {
    Slice slice{.vertices = std::move(vertices)};
    for (const std::size_t v : slice.vertices) {
      slice.area += frame_.area[v];
      slice.centre = slice.centre + frame_.area[v] * frame_.place[v];
    }
    slice.centre = (1.0 / slice.area) * slice.centre;
    Mat3 moment{};
    for (const std::size_t v : slice.vertices) {
      const Vec3 p = frame_.place[v] - slice.centre;
      for (int r = 0; r < 3; ++r) {
        moment[r] = moment[r] + (-frame_.area[v] * p[r]) * p;
        moment[r][r] += frame_.area[v] * dot(p, p);
      }
    }
    slice.by_moment = calc_inverse(moment);
    return slice;
  }

  ModeKind finish(MotionKind motion, const std::vector<double>& along) const {
    ModeKind kind{.motion = motion};
    if (const int nodes = count_nodes(along); 3 * nodes <= static_cast<int>(slices_.size())) kind.nodes = nodes;
    return kind;
  }

  const Frame& frame_;
  std::vector<Slice> slices_;
};

/// Symmetry axis of a round body, else nullopt.
std::optional<int> find_round_axis(const Frame& frame) {
  const Vec3& m = frame.axes.moment;
  if (m[0] < (1.0 + kSphereTolerance) * m[2]) return std::nullopt;  // nearly a sphere: no unique axis
  const int axis = m[0] - m[1] < m[1] - m[2] ? 2 : 0, x = (axis + 1) % 3, y = (axis + 2) % 3;
  if (m[std::min(x, y)] > (1.0 + kSquareTolerance) * m[std::max(x, y)]) return std::nullopt;
  const double middle = 0.5 * (frame.extent[0][axis] + frame.extent[1][axis]), half = std::max(0.5 * frame.size(axis), 1e-300);
  for (int n = 1; n <= kMaxOrder; ++n) {
    std::array<std::complex<double>, 3> sum{};
    for (std::size_t v = 0; v < frame.place.size(); ++v) {
      const Vec3& p = frame.place[v];
      const std::complex<double> turn = frame.area[v] * std::polar(1.0, n * std::atan2(p[y], p[x]));
      const double height = (p[axis] - middle) / half;
      for (int power = 0; power < 3; ++power) sum[power] += std::pow(height, power) * turn;
    }
    for (const std::complex<double>& one : sum)
      if (std::abs(one) > kRoundTolerance * frame.all_area) return std::nullopt;
  }
  return axis;
}

/// Rings of a round body.
class Rings {
 public:
  Rings(const Frame& frame, int axis) : frame_(frame), axis_(axis), x_((axis + 1) % 3), y_((axis + 2) % 3) {
    double largest = 0.0;
    for (const Vec3& p : frame.place) {
      radius_.push_back(std::hypot(p[x_], p[y_]));
      turn_.push_back(std::polar(1.0, std::atan2(p[y_], p[x_])));
      largest = std::max(largest, radius_.back());
    }
    for (std::size_t v = 0; v < frame.place.size(); ++v) {
      const std::size_t out = std::min(static_cast<int>(kRings * radius_[v] / largest), kRings - 1);
      ring_.push_back(kRings * frame.find_part(frame.place[v], axis, kRings) + out);
    }
  }

  ModeKind find(const Shape& shape) const {
    using Sums = std::array<std::array<std::complex<double>, 3>, kMaxOrder + 1>;  // by order: radial, around, along
    std::vector<Sums> sums(kRings * kRings);
    std::vector<double> area(sums.size(), 0.0);
    double radial = 0.0;
    for (std::size_t v = 0; v < ring_.size(); ++v) {
      const Vec3& u = shape[v];
      const double c = turn_[v].real(), s = turn_[v].imag(), a = frame_.area[v];
      const Vec3 part{c * u[x_] + s * u[y_], c * u[y_] - s * u[x_], u[axis_]};
      radial += a * square(part[0]);
      area[ring_[v]] += a;
      std::complex<double> wave = a;
      for (int n = 0; n <= kMaxOrder; ++n, wave *= turn_[v])
        for (int k = 0; k < 3; ++k) sums[ring_[v]][n][k] += part[k] * wave;
    }
    std::array<double, kMaxOrder + 1> energy{};
    double around = 0.0, outward = 0.0;
    for (std::size_t r = 0; r < sums.size(); ++r) {
      if (area[r] == 0.0) continue;
      for (int n = 0; n <= kMaxOrder; ++n)
        for (int k = 0; k < 3; ++k) energy[n] += (n == 0 ? 1.0 : 2.0) * std::norm(sums[r][n][k]) / area[r];
      around += std::norm(sums[r][0][1]) / area[r];
      outward += sums[r][0][0].real();
    }
    const auto most = std::max_element(energy.begin(), energy.end());
    if (*most < kOneOrder * shape.energy()) return {};
    const int order = static_cast<int>(most - energy.begin());
    if (order == 0 && around > kOneKind * energy[0]) return {.motion = MotionKind::kTorsion};
    const bool breathes = radial > 0.5 * shape.energy() && square(outward) > kMinBreathingFlow * frame_.all_area * radial;
    if (order == 0 && breathes) return {.motion = MotionKind::kBreathing};
    return {.motion = MotionKind::kDiameters, .nodes = order};
  }

 private:
  const Frame& frame_;
  int axis_, x_, y_;
  std::vector<double> radius_;
  std::vector<std::complex<double>> turn_;
  std::vector<std::size_t> ring_;
};

/// Kind of a flat body's mode, from cells.
ModeKind find_plate_kind(const Frame& frame, const Shape& shape) {
  std::array<std::array<double, kCells>, kCells> cell{}, area{};
  double normal = 0.0;
  for (std::size_t v = 0; v < frame.place.size(); ++v) {
    const std::size_t i = frame.find_part(frame.place[v], 0, kCells), j = frame.find_part(frame.place[v], 1, kCells);
    normal += frame.area[v] * square(shape[v][2]);
    cell[i][j] += frame.area[v] * shape[v][2];
    area[i][j] += frame.area[v];
  }
  if (normal < (1.0 - kOnePlane) * shape.energy()) return {.motion = MotionKind::kInPlane};
  if (normal < kOnePlane * shape.energy()) return {};
  ModeKind kind{.motion = MotionKind::kPlateBending};
  double all = 0.0;
  for (int i = 0; i < kCells; ++i)
    for (int j = 0; j < kCells; ++j) {
      if (area[i][j] == 0.0) return kind;  // not a rectangle, or too coarse
      cell[i][j] /= area[i][j];
      all += square(cell[i][j]);
    }
  // Largest singular value by power iteration, started from each row: a single start may be orthogonal to the vector.
  std::vector<double> along(kCells), across(kCells);
  double largest = 0.0;
  for (int row = 0; row < kCells; ++row) {
    std::vector<double> f(kCells), g(cell[row].begin(), cell[row].end());
    double value = 0.0;
    for (int step = 0; step < 50; ++step) {
      double size = 0.0;
      for (const double x : g) size += x * x;
      if (!(size > 0.0)) break;
      for (double& x : g) x /= std::sqrt(size);
      for (int i = 0; i < kCells; ++i) {
        f[i] = 0.0;
        for (int j = 0; j < kCells; ++j) f[i] += cell[i][j] * g[j];
      }
      value = 0.0;
      for (int j = 0; j < kCells; ++j) {
        g[j] = 0.0;
        for (int i = 0; i < kCells; ++i) g[j] += cell[i][j] * f[i];
      }
      for (const double x : f) value += x * x;
    }
    if (value <= largest) continue;
    largest = value;
    along = f;
    across = g;
  }
  if (largest < kProduct * all) return kind;
  const int nodes = count_nodes(along), lines = count_nodes(across);
  if (std::max(nodes, lines) > kCells / 3) return kind;
  kind.nodes = nodes;
  kind.lines = lines;
  return kind;
}

/// Outer surface, for breathing modes.
class Skin {
 public:
  Skin(const Bank& bank, const Frame& frame) : normal_(bank.vertex_count()) {
    for (const Triangle& t : find_outer_triangles(bank.vertices_m, bank.triangles)) {
      const Vec3 third = (1.0 / 6.0) * (frame.axes.axis * calc_normal(bank.vertices_m, t));
      for (const std::int32_t v : t) normal_[v] = normal_[v] + third;
    }
  }

  bool breathes(const Shape& shape) const {
    double flow = 0.0, area = 0.0, normal = 0.0, all = 0.0;
    for (std::size_t v = 0; v < normal_.size(); ++v) {
      const double a = norm(normal_[v]);
      if (a == 0.0) continue;
      const double out = dot(normal_[v], shape[v]) / a;
      flow += a * out;
      area += a;
      normal += a * square(out);
      all += a * dot(shape[v], shape[v]);
    }
    return square(flow) > kMinBreathingFlow * area * normal && normal > kOneKind * all;
  }

 private:
  std::vector<Vec3> normal_;  // (V) area times normal, principal axes
};

constexpr std::array kNames{"-", "bending", "lateral bending", "torsion", "longitudinal", "breathing", "", "plate bending", "in plane"};

const char* get_name(MotionKind motion) { return kNames.at(static_cast<std::size_t>(motion)); }

}  // namespace

std::vector<ModeKind> find_kinds(const Bank& bank, std::size_t count) {
  std::vector<ModeKind> kinds(std::min(count, bank.mode_count()));
  if (kinds.empty()) return kinds;
  const Frame frame = make_frame(bank);
  if (!(frame.all_area > 0.0) || !std::isfinite(frame.all_area)) return kinds;  // degenerate surface
  const bool is_long = frame.size(0) > kLong * frame.size(1), is_flat = frame.size(2) < kFlat * frame.size(1);
  const std::optional<int> axis = find_round_axis(frame);
  const Slices slices(frame);
  const Skin skin(bank, frame);
  const std::optional<Rings> rings = axis ? std::optional<Rings>(std::in_place, frame, *axis) : std::nullopt;
  for (std::size_t m = 0; m < kinds.size(); ++m) {
    const Shape shape(bank, frame, m);
    if (is_long) kinds[m] = slices.find(shape);
    if (kinds[m].motion == MotionKind::kUnknown && skin.breathes(shape)) kinds[m].motion = MotionKind::kBreathing;
    if (kinds[m].motion == MotionKind::kUnknown && rings) kinds[m] = rings->find(shape);
    if (kinds[m].motion == MotionKind::kUnknown && is_flat && !rings && !is_long) kinds[m] = find_plate_kind(frame, shape);
  }
  return kinds;
}

std::string describe(const ModeKind& kind) {
  const int nodes = kind.nodes.value_or(0);
  const auto count = [](int n, const char* what) { return fmt::format("{} {}{}", n, what, n == 1 ? "" : "s"); };
  if (kind.motion == MotionKind::kDiameters) return count(nodes, "diameter");
  if (kind.lines && kind.nodes) return fmt::format("{}, {} x {} lines", get_name(kind.motion), nodes, *kind.lines);
  if (kind.nodes) return fmt::format("{}, {}", get_name(kind.motion), count(nodes, "node"));
  return get_name(kind.motion);
}

}  // namespace carillon::bank
