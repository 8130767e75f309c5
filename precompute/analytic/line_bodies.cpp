#include "precompute/analytic/line_bodies.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "precompute/analytic/polynomials.hpp"
#include "precompute/analytic/stretch.hpp"
#include "runtime/base/error.hpp"

namespace carillon::analytic {
namespace {

using std::numbers::pi;

constexpr int kDiscSides = 12;
constexpr int kMinLineGrid = 40, kMaxLineGrid = 400;
constexpr int kPerHalfWave = 8;       // grid intervals
constexpr double kThickWaves = 0.25;  // depth over half a wavelength above which Euler-Bernoulli is several per cent off
constexpr int kMaxPolynomials = 600;

std::vector<Point2> make_disc_section(double diameter_m) {
  std::vector<Point2> section;
  for (int k = 0; k < kDiscSides; ++k) {
    const double angle = 2.0 * pi * k / kDiscSides;
    section.push_back({0.5 * diameter_m * std::cos(angle), 0.5 * diameter_m * std::sin(angle)});
  }
  return section;
}

bank::RigidBody calc_rod_rigid(double length_m, double mass_kg, double area_m2, double square_y_m2, double square_z_m2) {
  bank::RigidBody rigid;
  rigid.mass_kg = mass_kg;
  rigid.volume_m3 = area_m2 * length_m;
  rigid.centre_m = {0.5 * length_m, 0.0, 0.0};
  const double along = length_m * length_m / 12.0;
  rigid.inertia_kg_m2 = {mass_kg * (square_y_m2 + square_z_m2), 0.0, 0.0, 0.0, mass_kg * (along + square_z_m2), 0.0, 0.0, 0.0,
                         mass_kg * (along + square_y_m2)};
  return rigid;
}

}  // namespace

String::String(const job::StringBody& body, const material::Material& material) : length_m_(body.length_m) {
  const double density = material.density_kg_m3;
  mass_kg_m_ = body.mass_kg_m.value_or(density * pi / 4.0 * square(body.diameter_m.value_or(0.0)));
  diameter_m_ = body.diameter_m.value_or(std::sqrt(4.0 * mass_kg_m_ / (pi * density)));
  tension_n_ = body.tension_n ? *body.tension_n : mass_kg_m_ * square(2.0 * length_m_ * *body.lowest_hz);
  stiffness_ =
      body.diameter_m ? pi * pi * pi * material.young_modulus_pa * std::pow(diameter_m_, 4) / (64.0 * tension_n_ * square(length_m_)) : 0.0;
  const double square_m2 = square(diameter_m_) / 16.0;
  rigid = calc_rod_rigid(length_m_, mass_kg_m_ * length_m_, pi / 4.0 * square(diameter_m_), square_m2, square_m2);
  theory = stiffness_ > 0.0 ? fmt::format("stiff string, hinged at both ends, B = {:.4g}", stiffness_) : "ideal string, fixed at both ends";
  method = "closed form: every number of half-waves up to the end of the band, along y and along z";
}

ModeList String::list_modes(double high_hz, std::int64_t max_modes) {
  const double first_hz = std::sqrt(tension_n_ / mass_kg_m_) / (2.0 * length_m_), most = 0.5 * static_cast<double>(max_modes) + 1.0;
  high_hz = std::min(high_hz, (most + 0.5) * first_hz * std::sqrt(1.0 + stiffness_ * square(most + 0.5)));
  ModeList list{{}, high_hz};
  check_mode_count(2.0 * high_hz / first_hz, high_hz);
  for (int n = 1;; ++n) {
    const double hz = n * first_hz * std::sqrt(1.0 + stiffness_ * n * n);
    if (hz > high_hz) return list;
    for (int axis = 1; axis <= 2; ++axis)
      list.modes.push_back({square(2.0 * pi * hz), 0.0, {n, axis, 0, 0}, fmt::format("{}, along {}", n, axis == 1 ? 'y' : 'z')});
  }
}

void String::calc_shapes(const Vec3& point_m, std::span<const Mode> modes, std::span<Vec3> phi) const {
  const double x = std::clamp(point_m[0] / length_m_, 0.0, 1.0), scale = std::sqrt(2.0 / (mass_kg_m_ * length_m_));
  for (std::size_t m = 0; m < modes.size(); ++m) {
    phi[m] = {0.0, 0.0, 0.0};
    phi[m][modes[m].index[1]] = scale * std::sin(modes[m].index[0] * pi * x);
  }
}

ClosedSurface String::make_surface(int grid) const { return make_prism(length_m_, make_disc_section(diameter_m_), grid); }

bank::QuarticEnergy String::calc_coupling(std::span<const Mode> modes, const material::Material& material, bool) const {
  bank::QuarticEnergy energy;
  const double rigidity_n = material.young_modulus_pa * pi / 4.0 * square(diameter_m_);
  std::vector<double> row;
  for (const Mode& mode : modes)
    row.push_back(std::sqrt(rigidity_n / (4.0 * length_m_)) * square(mode.index[0] * pi / length_m_) / mass_kg_m_);
  append_diagonal_row(row, energy);
  energy.membrane_ratio = std::sqrt(rigidity_n / mass_kg_m_) / (2.0 * length_m_);
  energy.thickness_m = diameter_m_;
  return energy;
}

int String::choose_grid(std::span<const Mode> modes) const {
  int half_waves = 1;
  for (const Mode& mode : modes) half_waves = std::max(half_waves, mode.index[0]);
  return std::clamp(kPerHalfWave * half_waves, kMinLineGrid, kMaxLineGrid);
}

double calc_torsion_constant(double width_m, double thickness_m) {
  const double a = std::max(width_m, thickness_m), b = std::min(width_m, thickness_m);
  double sum = 0.0;
  for (int n = 1; n < 200; n += 2) sum += std::tanh(n * pi * a / (2.0 * b)) / std::pow(n, 5);
  return a * b * b * b * (1.0 / 3.0 - 64.0 / std::pow(pi, 5) * b / a * sum);
}

Beam::Beam(const job::BeamBody& body, const material::Material& material)
    : body_(body),
      young_pa_(material.young_modulus_pa),
      shear_pa_(material.lame_mu_pa()),
      density_kg_m3_(material.density_kg_m3),
      poisson_ratio_(material.poisson_ratio) {
  if (body.diameter_m) {
    const double d = *body.diameter_m;
    area_m2_ = pi / 4.0 * d * d;
    moment_y_m4_ = moment_z_m4_ = pi / 64.0 * std::pow(d, 4);
    torsion_m4_ = 2.0 * moment_y_m4_;
  } else {
    const double b = *body.width_m, h = *body.thickness_m;
    area_m2_ = b * h;
    moment_y_m4_ = h * b * b * b / 12.0;
    moment_z_m4_ = b * h * h * h / 12.0;
    torsion_m4_ = calc_torsion_constant(b, h);
  }
  rigid =
      calc_rod_rigid(body.length_m, density_kg_m3_ * area_m2_ * body.length_m, area_m2_, moment_y_m4_ / area_m2_, moment_z_m4_ / area_m2_);
  const bool is_free = !is_fixed(0) && !is_fixed(1);
  rigid_modes = is_free ? 6 : 2 * count_mechanisms(body.ends);
  theory = fmt::format("{} beam, ends {} and {}", body.is_timoshenko ? "Timoshenko" : "Euler-Bernoulli", to_text(body.ends[0]),
                       to_text(body.ends[1]));
  method = body.is_timoshenko ? "Ritz's method on Legendre polynomials for bending; closed forms for torsion and axial waves"
                              : "closed form: every root up to the end of the band, of each motion";
}

ModeList Beam::list_modes(double high_hz, std::int64_t) {
  ModeList list{{}, high_hz};
  shapes_.clear();
  if (body_.has_bending)
    for (const auto& [motion, moment] : {std::pair(kBendingY, moment_y_m4_), std::pair(kBendingZ, moment_z_m4_)}) {
      if (body_.is_timoshenko)
        add_timoshenko(motion, moment, high_hz, list.modes);
      else
        add_bending(motion, moment, high_hz, list.modes);
    }
  const double polar = moment_y_m4_ + moment_z_m4_;
  if (body_.has_torsion) add_waves(kTorsion, std::sqrt(shear_pa_ * torsion_m4_ / (density_kg_m3_ * polar)), high_hz, list.modes);
  if (body_.has_axial) add_waves(kAxial, std::sqrt(young_pa_ / density_kg_m3_), high_hz, list.modes);
  sort_modes(list.modes);
  return list;
}

void Beam::add_bending(Motion motion, double second_moment_m4, double high_hz, std::vector<Mode>& modes) {
  const double length = body_.length_m, rate = std::sqrt(young_pa_ * second_moment_m4 / (density_kg_m3_ * area_m2_)) / square(length);
  const double max_beta = std::sqrt(2.0 * pi * high_hz / rate);
  check_mode_count(max_beta / pi, high_hz);
  const std::vector<double> roots = find_beam_roots(body_.ends, max_beta);
  const double depth = std::sqrt(12.0 * second_moment_m4 / area_m2_);
  const char axis = motion == kBendingY ? 'y' : 'z';
  const auto is_thick = [&](double beta) { return depth * beta / (pi * length) > kThickWaves; };
  const bool is_said = motion == kBendingZ && moment_y_m4_ == moment_z_m4_;
  if (const auto thick = std::find_if(roots.begin(), roots.end(), is_thick); thick != roots.end() && !is_said)
    warnings.push_back(fmt::format(
        "bending along {}: from {:.0f} Hz on half a wavelength is less than four times the depth, and Euler-Bernoulli is several per cent "
        "too high; \"theory\": \"timoshenko\" includes shear and rotary inertia",
        axis, square(*thick) * rate / (2.0 * pi)));
  for (std::size_t n = 0; n < roots.size(); ++n) {
    modes.push_back({square(square(roots[n]) * rate),
                     0.0,
                     {motion, static_cast<int>(n) + 1, static_cast<int>(shapes_.size()), 0},
                     fmt::format("bending {}, {}", axis, n + 1)});
    shapes_.push_back({make_beam_function(body_.ends, roots[n]), {}, {}, 0.0});
  }
}

/// Unknowns: the deflection w and L times the shear angle g = w' - slope, in Legendre polynomials of x / L. With g instead of the slope, no
/// large terms cancel in a thin beam: strain energy E I / L^3 (w'' - g')^2 + k G A / L g^2, mass rho A L w^2 + rho I / L (w' - g)^2.
void Beam::add_timoshenko(Motion motion, double second_moment_m4, double high_hz, std::vector<Mode>& modes) {
  const double length = body_.length_m, nu = poisson_ratio_;
  const double correction = body_.diameter_m ? 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu) : 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu);  // Cowper 1966
  const double mass = density_kg_m3_ * area_m2_ * length, turning = density_kg_m3_ * second_moment_m4 / length;
  const double bending = young_pa_ * second_moment_m4 / (length * length * length), shear = correction * shear_pa_ * area_m2_ / length;
  const double rate = std::sqrt(young_pa_ * second_moment_m4 / (density_kg_m3_ * area_m2_)) / square(length);
  // Shear shortens waves; the number of functions suffices up to half a wavelength equal to the depth.
  const double slow_m_s = std::sqrt(correction * shear_pa_ / density_kg_m3_);
  const double waves = std::max(std::sqrt(2.0 * pi * high_hz / rate), 2.0 * pi * high_hz * length / slow_m_s) / pi;
  const int wanted = 20 + static_cast<int>(std::ceil(1.8 * std::min(waves, 1e6)));
  if (wanted > kMaxPolynomials)
    throw InputError(
        fmt::format("the beam has about {:.0f} half-waves at {:g} Hz, more than Ritz's method can resolve ({}); lower the end "
                    "of \"band_hz\", or use \"theory\": \"euler-bernoulli\"",
                    waves, high_hz, static_cast<int>((kMaxPolynomials - 20) / 1.8)));
  const double high = square(2.0 * pi * high_hz), shift = 1e-3 * high;
  /// lambda, ascending, and coefficients of w and g, columns of unit modal mass.
  const auto solve = [&](int n, la::Matrix& shapes) {
    const la::Matrix unit = la::Matrix::Identity(n, n), first = calc_products(n, 1, 1), second = calc_products(n, 2, 2);
    const la::Matrix bend = calc_products(n, 2, 1), turn = calc_products(n, 1, 0);
    la::Matrix stiffness(2 * n, 2 * n), weight(2 * n, 2 * n);
    stiffness << bending * second, -bending * bend, -bending * bend.transpose(), bending * first + shear * unit;
    weight << mass * unit + turning * first, -turning * turn, -turning * turn.transpose(), turning * unit;
    std::vector<la::Vector> conditions;
    for (int end = 0; end < 2; ++end) {
      const job::Edge edge = body_.ends[end];
      la::Vector deflection = la::Vector::Zero(2 * n), slope = la::Vector::Zero(2 * n);
      deflection.head(n) = calc_legendre(n, end);
      slope << calc_legendre(n, end, 1), -calc_legendre(n, end);
      if (edge == job::Edge::hinged || edge == job::Edge::clamped) conditions.push_back(deflection);
      if (edge == job::Edge::sliding || edge == job::Edge::clamped) conditions.push_back(slope);
    }
    const la::Matrix basis = make_null_space(2 * n, conditions);
    // The lowest modes are the largest eigenvalues of (K + shift M)^-1 M, which stay accurate for high shear stiffness.
    la::Matrix vectors = basis.transpose() * weight * basis, shifted = basis.transpose() * stiffness * basis + shift * vectors;
    la::Vector values;
    if (la::calc_generalised_eigenpairs_by_division(vectors, shifted, values) != 0)
      throw SolveError("the dense eigensolver failed on the beam");
    Eigen::Index count = 0;
    while (count < values.size() && values(values.size() - 1 - count) * (1.02 * high + shift) >= 1.0) ++count;
    const la::Matrix last = vectors.rightCols(count).rowwise().reverse();
    const la::Vector found = values.tail(count).reverse();
    shapes = basis * last * found.cwiseSqrt().cwiseInverse().asDiagonal();
    return la::Vector(found.cwiseInverse().array() - shift);
  };
  la::Matrix shapes, ignored;
  const la::Vector coarse = solve(wanted * 3 / 4, ignored), fine = solve(wanted, shapes);
  for (Eigen::Index k = count_mechanisms(body_.ends); k < fine.size() && fine(k) <= high; ++k) {
    const double rounding = 1e-14 * square(fine(k) + shift) / shift;
    const double apart = (k < coarse.size() ? std::abs(coarse(k) - fine(k)) : fine(k)) + rounding;
    const int n = static_cast<int>(k) + 1 - count_mechanisms(body_.ends);
    modes.push_back({fine(k),
                     600.0 * std::log2(1.0 + apart / fine(k)),
                     {motion, n, static_cast<int>(shapes_.size()), 0},
                     fmt::format("bending {}, {}", motion == kBendingY ? 'y' : 'z', n)});
    const la::Vector w = shapes.col(k).head(wanted), g = shapes.col(k).tail(wanted);
    const double at_end = calc_legendre(wanted, 0.0).dot(w),
                 turned = calc_legendre(wanted, 0.0, 1).dot(w) - calc_legendre(wanted, 0.0).dot(g);
    const double sign = std::copysign(1.0, std::abs(at_end) > 1e-6 * w.norm() ? at_end : turned);
    shapes_.push_back({{}, sign * w, sign * g, 0.0});
  }
}

void Beam::add_waves(Motion motion, double speed_m_s, double high_hz, std::vector<Mode>& modes) {
  const double shift = is_fixed(0) != is_fixed(1) ? 0.5 : 0.0;
  check_mode_count(2.0 * body_.length_m * high_hz / speed_m_s, high_hz);
  for (int n = 1;; ++n) {
    const double wave = (n - shift) * pi, hz = wave * speed_m_s / (2.0 * pi * body_.length_m);
    if (hz > high_hz) return;
    modes.push_back({square(2.0 * pi * hz),
                     0.0,
                     {motion, n, static_cast<int>(shapes_.size()), 0},
                     fmt::format("{}, {}", motion == kTorsion ? "torsion" : "axial", n)});
    shapes_.push_back({{}, {}, {}, wave});
  }
}

void Beam::calc_shapes(const Vec3& point_m, std::span<const Mode> modes, std::span<Vec3> phi) const {
  const double x = std::clamp(point_m[0] / body_.length_m, 0.0, 1.0), y = point_m[1], z = point_m[2];
  const double mass = density_kg_m3_ * area_m2_ * body_.length_m;
  la::Vector polynomials, derivatives;
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const Shape& shape = shapes_[modes[m].index[2]];
    const int motion = modes[m].index[0];
    if (motion == kBendingY || motion == kBendingZ) {
      const std::size_t axis = motion == kBendingY ? 1 : 2;
      phi[m] = {0.0, 0.0, 0.0};
      if (!body_.is_timoshenko) {
        phi[m][axis] = shape.function.calc(x) / std::sqrt(mass);
        continue;
      }
      if (polynomials.size() != shape.deflection.size()) {
        polynomials = calc_legendre(static_cast<int>(shape.deflection.size()), x);
        derivatives = calc_legendre(static_cast<int>(shape.deflection.size()), x, 1);
      }
      phi[m][axis] = polynomials.dot(shape.deflection);
      phi[m][0] = -(axis == 1 ? y : z) * (derivatives.dot(shape.deflection) - polynomials.dot(shape.shear)) / body_.length_m;
      continue;
    }
    const double wave = std::sqrt(2.0) * (is_fixed(0) ? std::sin(shape.wave * x) : std::cos(shape.wave * x));
    if (motion == kAxial) {
      phi[m] = {wave / std::sqrt(mass), 0.0, 0.0};
    } else {
      const double angle = wave / std::sqrt(density_kg_m3_ * (moment_y_m4_ + moment_z_m4_) * body_.length_m);
      phi[m] = {0.0, -z * angle, y * angle};
    }
  }
}

ClosedSurface Beam::make_surface(int grid) const {
  if (body_.diameter_m) return make_prism(body_.length_m, make_disc_section(*body_.diameter_m), grid);
  const double y = 0.5 * *body_.width_m, z = 0.5 * *body_.thickness_m;
  return make_prism(body_.length_m, {{0, -z}, {y, -z}, {y, 0}, {y, z}, {0, z}, {-y, z}, {-y, 0}, {-y, -z}}, grid);
}

bank::QuarticEnergy Beam::calc_coupling(std::span<const Mode> modes, const material::Material&, bool) const {
  const double length = body_.length_m, mass = density_kg_m3_ * area_m2_ * length;
  const auto n = static_cast<Eigen::Index>(modes.size());
  la::Matrix slopes = la::Matrix::Zero(n, n);  // integrals of w_i' w_j' [1/(m kg)]
  int half_waves = 1, polynomials = 1;
  std::vector<const Shape*> shapes;
  for (const Mode& mode : modes) {
    shapes.push_back(&shapes_[mode.index[2]]);
    half_waves = std::max(half_waves, mode.index[1] + 1);
    polynomials = std::max(polynomials, static_cast<int>(shapes.back()->deflection.size()));
  }
  const GaussRule rule = make_gauss_rule(40 + 4 * half_waves);
  const la::Matrix products = body_.is_timoshenko ? calc_products(polynomials, 1, 1) : la::Matrix();
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = 0; i <= j; ++i) {
      if (modes[i].index[0] != modes[j].index[0]) continue;
      const Shape &one = *shapes[i], &other = *shapes[j];
      double sum = 0.0;
      if (body_.is_timoshenko) {
        const Eigen::Index count = std::min(one.deflection.size(), other.deflection.size());
        sum = one.deflection.head(count).dot(products.topLeftCorner(count, count) * other.deflection.head(count)) / length;
      } else {
        for (std::size_t k = 0; k < rule.x.size(); ++k)
          sum += rule.weight[k] * one.function.calc(rule.x[k], 1) * other.function.calc(rule.x[k], 1);
        sum *= one.function.beta * other.function.beta / (mass * length);
      }
      slopes(i, j) = slopes(j, i) = sum;
    }
  bank::QuarticEnergy energy;
  append_row(std::sqrt(young_pa_ * area_m2_ / (4.0 * length)) * slopes, energy);
  energy.membrane_ratio = std::sqrt(young_pa_ / density_kg_m3_) / (2.0 * length);
  energy.thickness_m = body_.diameter_m ? *body_.diameter_m : std::min(*body_.width_m, *body_.thickness_m);
  return energy;
}

int Beam::choose_grid(std::span<const Mode> modes) const {
  int half_waves = 1;
  for (const Mode& mode : modes) half_waves = std::max(half_waves, mode.index[1] + 1);
  return std::clamp(kPerHalfWave * half_waves, kMinLineGrid, kMaxLineGrid);
}

}  // namespace carillon::analytic
