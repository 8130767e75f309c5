#include "precompute/analytic/flat_bodies.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "precompute/analytic/polynomials.hpp"
#include "precompute/analytic/stretch.hpp"

namespace carillon::analytic {
namespace {

using std::numbers::pi;

/// Grid intervals along the longest side for a number of half-waves along it: a multiple of ten.
int choose_flat_grid(double half_waves) {
  const int wanted = 10 * static_cast<int>(std::ceil(0.4 * half_waves));
  return std::clamp(wanted, 40, kMaxDefaultGrid);
}

void warn_if_thick(double thickness_m, double rate, double high_hz, std::vector<std::string>& warnings) {
  constexpr double kWaves = 10.0;  // wavelength over thickness below which Kirchhoff's theory is more than about 3 per cent sharp
  const double hz = 2.0 * pi * std::sqrt(rate) / square(kWaves * thickness_m);
  if (hz < high_hz)
    warnings.push_back(
        fmt::format("above {:.0f} Hz a wavelength is less than ten thicknesses, and Kirchhoff's theory is several per cent "
                    "too high; finite elements (\"shape\": \"plate\") include shear and rotary inertia",
                    hz));
}

/// Source of Z_(m+1)/Z_m and similar ratios; std::cyl_bessel_* are exact to about 1e-13 here.
double calc_j(int m, double x) { return std::cyl_bessel_j(m, x); }
double calc_i(int m, double x) { return std::cyl_bessel_i(m, x); }

constexpr double kMaxRoot = 600.0;  // I_m overflows beyond it

/// high_hz, or a lower frequency with about max_modes modes below it.
double find_enough_hz(double high_hz, bool is_plate, double rate, double area_m2, double rim_m, std::int64_t max_modes) {
  const double k = find_wave_number(area_m2, rim_m, 1.05 * static_cast<double>(max_modes) + 5.0);
  return std::min(high_hz, std::sqrt(rate) * (is_plate ? k * k : k) / (2.0 * pi));
}

}  // namespace

std::array<double, 2> find_sheet(const job::MembraneBody& body, const material::Material& material) {
  const double density = material.density_kg_m3;
  const double per_area = body.density_kg_m2 ? *body.density_kg_m2 : *body.thickness_m * density;
  return {per_area, body.thickness_m ? *body.thickness_m : per_area / density};
}

double calc_plate_rate(const material::Material& material, double thickness_m) {
  return material.young_modulus_pa * square(thickness_m) / (12.0 * (1.0 - square(material.poisson_ratio)) * material.density_kg_m3);
}

double find_wave_number(double area_m2, double rim_m, double modes) {
  return (rim_m + std::sqrt(square(rim_m) + 16.0 * pi * modes * area_m2)) / (2.0 * area_m2);
}

void FlatBody::calc_shapes(const Vec3& point_m, std::span<const Mode> modes, std::span<Vec3> phi) const {
  std::vector<double> w(modes.size());
  calc_deflections({point_m[0], point_m[1]}, modes, w);
  for (std::size_t m = 0; m < modes.size(); ++m) phi[m] = {0.0, 0.0, w[m]};
}

bank::QuarticEnergy FlatBody::calc_coupling(std::span<const Mode> modes, const material::Material& material, bool) const {
  constexpr double kFirstZero = 2.404825557695773;  // of J_0
  const double area = rigid.volume_m3 / thickness_m_, nu = material.poisson_ratio;
  bank::QuarticEnergy energy;
  append_row(std::sqrt(material.young_modulus_pa * thickness_m_ / (4.0 * area * (1.0 - nu * nu))) * calc_slope_products(modes), energy);
  const double shear_m_s = std::sqrt(material.lame_mu_pa() * rigid.volume_m3 / rigid.mass_kg);
  energy.membrane_ratio = shear_m_s * kFirstZero * std::sqrt(pi / area) / (2.0 * pi);
  energy.thickness_m = thickness_m_;
  return energy;
}

void FlatBody::set_rigid(double density_kg_m2) {
  const Net net = make_net(kMaxDefaultGrid);
  const double area = calc_slab_rigid(net, thickness_m_, 1.0).volume_m3 / thickness_m_;
  rigid = calc_slab_rigid(net, thickness_m_, density_kg_m2 * area);
}

SineRectangle::SineRectangle(const job::MembraneBody& body, const material::Material& material)
    : length_m_(body.length_m), width_m_(body.width_m), is_plate_(false) {
  std::tie(density_kg_m2_, thickness_m_) = std::tuple_cat(find_sheet(body, material));
  const double lowest = square(1.0 / length_m_) + square(1.0 / width_m_);
  rate_ = body.tension_n_m ? *body.tension_n_m / density_kg_m2_ : square(2.0 * *body.lowest_hz) / lowest;
  theory = "rectangular membrane, fixed along its rim";
  method = "closed form: all numbers of half-waves along both sides up to the end of the band";
  set_rigid(density_kg_m2_);
}

SineRectangle::SineRectangle(const job::PlateBody& body, const material::Material& material)
    : length_m_(body.length_m), width_m_(body.width_m), density_kg_m2_(material.density_kg_m3 * body.thickness_m), is_plate_(true) {
  thickness_m_ = body.thickness_m;
  rate_ = calc_plate_rate(material, thickness_m_);
  theory = "rectangular plate (Kirchhoff), hinged on all sides";
  method = "closed form: all numbers of half-waves along both sides up to the end of the band";
  set_rigid(density_kg_m2_);
}

ModeList SineRectangle::list_modes(double high_hz, std::int64_t max_modes) {
  high_hz = find_enough_hz(high_hz, is_plate_, rate_, length_m_ * width_m_, 2.0 * (length_m_ + width_m_), max_modes);
  ModeList list{{}, high_hz};
  const double high = square(2.0 * pi * high_hz);
  const double k2_high = is_plate_ ? std::sqrt(high / rate_) : high / rate_;
  check_mode_count(std::max(0.25 / pi * length_m_ * width_m_ * k2_high, std::sqrt(k2_high) * std::max(length_m_, width_m_) / pi), high_hz);
  const auto calc_lambda = [&](int m, int n) {
    const double k2 = square(pi) * (square(m / length_m_) + square(n / width_m_));
    return is_plate_ ? rate_ * k2 * k2 : rate_ * k2;
  };
  for (int m = 1; calc_lambda(m, 1) <= high; ++m)
    for (int n = 1; calc_lambda(m, n) <= high; ++n)
      list.modes.push_back({calc_lambda(m, n), 0.0, {m, n, 0, 0}, fmt::format("({}, {})", m, n)});
  sort_modes(list.modes);
  if (is_plate_) warn_if_thick(thickness_m_, rate_, high_hz, warnings);
  return list;
}

void SineRectangle::calc_deflections(const Point2& point_m, std::span<const Mode> modes, std::span<double> w) const {
  std::array<int, 2> largest{0, 0};
  for (const Mode& mode : modes)
    for (int side = 0; side < 2; ++side) largest[side] = std::max(largest[side], mode.index[side]);
  std::array<std::vector<double>, 2> sines;
  for (int side = 0; side < 2; ++side) {
    const double part = std::clamp(point_m[side] / (side == 0 ? length_m_ : width_m_), 0.0, 1.0);
    for (int k = 0; k <= largest[side]; ++k) sines[side].push_back(part == 1.0 ? 0.0 : std::sin(k * pi * part));
  }
  const double scale = 2.0 / std::sqrt(density_kg_m2_ * length_m_ * width_m_);
  for (std::size_t i = 0; i < modes.size(); ++i) w[i] = scale * sines[0][modes[i].index[0]] * sines[1][modes[i].index[1]];
}

la::Matrix SineRectangle::calc_slope_products(std::span<const Mode> modes) const {
  la::Matrix products = la::Matrix::Zero(static_cast<Eigen::Index>(modes.size()), static_cast<Eigen::Index>(modes.size()));
  for (std::size_t i = 0; i < modes.size(); ++i)
    products(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i)) =
        square(pi) * (square(modes[i].index[0] / length_m_) + square(modes[i].index[1] / width_m_)) / density_kg_m2_;
  return products;
}

/// del^4 F = E h (w_xy^2 - w_xx w_yy) with F a sum of cos(k pi x / a) cos(l pi y / b). For modes (m, n) and (m', n') the right-hand side
/// has the four products k = |m -+ m'|, l = |n -+ n'|; eta: coefficient over (k pi / a)^2 + (l pi / b)^2, normalised.
void SineRectangle::add_stress_functions(std::span<const Mode> modes, double rigidity_n_m, bank::QuarticEnergy& energy) const {
  const double area = length_m_ * width_m_, factor = 1.0 / (density_kg_m2_ * area);  // a quarter of the square of the amplitude
  std::map<std::array<int, 2>, std::size_t> places;
  const std::size_t pairs = bank::count_pairs(modes.size());
  for (const bool fills : {false, true}) {  // first pass counts the rows
    if (fills) {
      std::size_t row = energy.rows.size() / pairs;
      for (auto& [number, place] : places) place = row++;
      energy.rows.resize(row * pairs, 0.0F);
    }
    for (std::size_t j = 0; j < modes.size(); ++j)
      for (std::size_t i = 0; i <= j; ++i) {
        const auto &one = modes[i].index, &other = modes[j].index;
        const double ax = one[0] * pi / length_m_, ay = one[1] * pi / width_m_, bx = other[0] * pi / length_m_,
                     by = other[1] * pi / width_m_;
        for (const bool sums_x : {false, true})
          for (const bool sums_y : {false, true}) {
            const int k = sums_x ? one[0] + other[0] : std::abs(one[0] - other[0]);
            const int l = sums_y ? one[1] + other[1] : std::abs(one[1] - other[1]);
            const double part = sums_x == sums_y ? -square(ax * by - bx * ay) : square(ax * by + bx * ay);
            if (part == 0.0) continue;  // includes k = l = 0
            std::size_t& place = places[{k, l}];
            if (!fills) continue;
            const double norm = area * (k > 0 ? 0.5 : 1.0) * (l > 0 ? 0.5 : 1.0);
            const double wave = square(k * pi / length_m_) + square(l * pi / width_m_);
            energy.rows[place * pairs + bank::find_pair(i, j)] =
                static_cast<float>(0.5 * factor * part * std::sqrt(rigidity_n_m * norm) / wave);
          }
      }
  }
}

bank::QuarticEnergy SineRectangle::calc_coupling(std::span<const Mode> modes, const material::Material& material, bool is_stretch) const {
  bank::QuarticEnergy energy = FlatBody::calc_coupling(modes, material, is_stretch);
  if (!is_plate_) return energy;
  const double nu = material.poisson_ratio, area = length_m_ * width_m_, rigidity = material.young_modulus_pa * thickness_m_;
  // Self-coupling by the Airy function alone is E h a b (e_x^2 + e_y^2) / 4.
  const double airy = is_stretch ? 0.25 : 0.0;
  std::vector<double> sum, difference;
  for (const Mode& mode : modes) {
    const double x = 0.5 * square(mode.index[0] * pi / length_m_) / (density_kg_m2_ * area),
                 y = 0.5 * square(mode.index[1] * pi / width_m_) / (density_kg_m2_ * area);  // mean strains of q = 1
    sum.push_back(std::sqrt(area * rigidity * (0.5 / (1.0 - nu) + airy)) * (x + y));
    difference.push_back(std::sqrt(area * rigidity * (0.5 / (1.0 + nu) + airy)) * (x - y));
  }
  energy.rows.clear();
  append_diagonal_row(sum, energy);
  append_diagonal_row(difference, energy);
  if (!is_stretch) add_stress_functions(modes, rigidity, energy);
  const double longest = std::max(
      length_m_, width_m_);  // the sides move along themselves, so in-plane modes are slower than a pressure wave between the sides
  const double pressure_m_s = std::sqrt(material.young_modulus_pa / ((1.0 - nu * nu) * material.density_kg_m3));
  energy.membrane_ratio = std::min(energy.membrane_ratio, 0.5 * pressure_m_s / longest);
  return energy;
}

Net SineRectangle::make_net(int grid) const {
  const double longest = std::max(length_m_, width_m_);
  const auto cut = [&](double side) { return std::max(2, static_cast<int>(std::lround(grid * side / longest))); };
  return make_rectangle_net(length_m_, width_m_, cut(length_m_), cut(width_m_));
}

int SineRectangle::choose_grid(std::span<const Mode> modes) const {
  const double longest = std::max(length_m_, width_m_);
  double half_waves = 1.0;
  for (const Mode& mode : modes)
    half_waves = std::max({half_waves, mode.index[0] * longest / length_m_, mode.index[1] * longest / width_m_});
  return choose_flat_grid(half_waves);
}

Circle::Circle(const job::MembraneBody& body, const material::Material& material) : radius_m_(body.radius_m), is_plate_(false) {
  std::tie(density_kg_m2_, thickness_m_) = std::tuple_cat(find_sheet(body, material));
  constexpr double kFirstZero = 2.404825557695773;  // of J_0
  rate_ = body.tension_n_m ? *body.tension_n_m / density_kg_m2_ : square(2.0 * pi * radius_m_ * *body.lowest_hz / kFirstZero);
  theory = "circular membrane, fixed along its rim";
  method = "closed form: all zeros of the Bessel functions up to the end of the band";
  set_rigid(density_kg_m2_);
}

Circle::Circle(const job::PlateBody& body, const material::Material& material)
    : radius_m_(body.radius_m),
      density_kg_m2_(material.density_kg_m3 * body.thickness_m),
      poisson_ratio_(material.poisson_ratio),
      is_plate_(true),
      edge_(body.edges[0]) {
  thickness_m_ = body.thickness_m;
  rate_ = calc_plate_rate(material, thickness_m_);
  theory = fmt::format("circular plate (Kirchhoff), {} along its rim", to_text(edge_));
  method = "closed form: all roots of the determinant of J_m and I_m up to the end of the band, each m scanned";
  rigid_modes = edge_ == job::Edge::free ? 6 : edge_ == job::Edge::sliding ? 1 : 0;
  set_rigid(density_kg_m2_);
}

/// Boundary conditions at the rim for J_m(k r) and I_m(k r) / I_m(k R), in r / R: {J in the first, I in the first, J in the second, I in
/// the second}. With Z for either: slope k Z'; moment -+ k^2 Z - (1 - nu) (k Z' - m^2 Z); shear -+ k^3 Z' - (1 - nu) m^2 (k Z' - Z).
std::array<double, 4> Circle::calc_conditions(int m, double k) const {
  const double j = calc_j(m, k), j_next = calc_j(m + 1, k);
  const double i_ratio = calc_i(m + 1, k) / calc_i(m, k);
  const double m2 = square(m), soft = 1.0 - poisson_ratio_;
  const std::array<double, 2> z{j, 1.0}, slope{m * j - k * j_next, m + k * i_ratio}, sign{-1.0, 1.0};
  std::array<double, 2> moment, shear;
  for (int f = 0; f < 2; ++f) {
    moment[f] = sign[f] * k * k * z[f] - soft * (slope[f] - m2 * z[f]);
    shear[f] = sign[f] * k * k * slope[f] - soft * m2 * (slope[f] - z[f]);
  }
  const auto& first = edge_ == job::Edge::free ? moment : edge_ == job::Edge::sliding ? slope : z;
  const auto& second = edge_ == job::Edge::clamped ? slope : edge_ == job::Edge::hinged ? moment : shear;
  return {first[0], first[1], second[0], second[1]};
}

double Circle::calc_determinant(int m, double root) const {
  if (!is_plate_) return calc_j(m, root);
  const std::array<double, 4> c = calc_conditions(m, root);
  return c[0] * c[3] - c[1] * c[2];
}

Circle::Radial Circle::make_radial(int m, double k) const {
  Radial radial{m, k, 1.0, 0.0};
  const double j = calc_j(m, k), j_next = calc_j(m + 1, k), angular = m == 0 ? 2.0 * pi : pi;
  double square_mean = 0.5 * square(j_next);  // integral of r w^2 over 0 <= r <= 1
  if (is_plate_) {
    const std::array<double, 4> c = calc_conditions(m, k);
    // The larger I entry determines the amplitude ratio more accurately.
    const bool is_first = std::abs(c[1]) > std::abs(c[3]) * 1e-3 && edge_ != job::Edge::sliding;
    radial.modified = is_first ? -c[0] / c[1] : -c[2] / c[3];
    const double i_ratio = calc_i(m + 1, k) / calc_i(m, k), m2 = square(m / k);
    const double j_slope = m / k * j - j_next, i_slope = m / k + i_ratio;
    square_mean = 0.5 * (square(j_slope) + (1.0 - m2) * square(j)) + square(radial.modified) * 0.5 * ((1.0 + m2) - square(i_slope)) +
                  radial.modified * (j * i_ratio + j_next) / k;
  }
  const double scale = 1.0 / std::sqrt(density_kg_m2_ * square(radius_m_) * angular * square_mean);
  radial.bessel = scale;
  radial.modified *= scale;
  return radial;
}

ModeList Circle::list_modes(double high_hz, std::int64_t max_modes) {
  high_hz = find_enough_hz(high_hz, is_plate_, rate_, pi * square(radius_m_), 2.0 * pi * radius_m_, max_modes);
  ModeList list{{}, high_hz};
  radials_.clear();
  const double omega = 2.0 * pi * high_hz;
  const double max_root = (is_plate_ ? std::sqrt(omega / std::sqrt(rate_)) : omega / std::sqrt(rate_)) * radius_m_;
  if (max_root > kMaxRoot)
    throw InputError(fmt::format(
        "the circle has about {:.0f} half-waves across at {:g} Hz, more than {:.0f}; lower the end of \"band_hz\", or give \"max_modes\"",
        max_root / pi * 2.0, high_hz, kMaxRoot / pi * 2.0));
  // The first root of each m lies above 0.7 m, and roots of the same m are more than 2 apart.
  constexpr double kStep = 0.25, kFirst = 0.7;
  for (int m = 0; kFirst * m <= max_root; ++m) {
    double low = std::max(0.5, kFirst * m), value = calc_determinant(m, low);
    for (int s = 1; low < max_root;) {
      const double high = std::min(low + kStep, max_root), next = calc_determinant(m, high);
      if ((value > 0.0) != (next > 0.0)) {
        double a = low, b = high;
        while (true) {
          const double middle = 0.5 * (a + b);
          if (middle <= a || middle >= b) break;
          ((calc_determinant(m, middle) > 0.0) == (value > 0.0) ? a : b) = middle;
        }
        const double root = 0.5 * (a + b), k = root / radius_m_;
        for (int part = 0; part < (m == 0 ? 1 : 2); ++part)
          list.modes.push_back({is_plate_ ? rate_ * square(k * k) : rate_ * k * k,
                                0.0,
                                {m, s, part, static_cast<int>(radials_.size())},
                                fmt::format("({}, {}){}", m, s,
                                            m == 0      ? ""
                                            : part == 0 ? " cos"
                                                        : " sin")});
        radials_.push_back(make_radial(m, root));
        ++s;
      }
      low = high;
      value = next;
    }
  }
  sort_modes(list.modes);
  cached_radius_ = -1.0;
  if (is_plate_) warn_if_thick(thickness_m_, rate_, high_hz, warnings);
  return list;
}

void Circle::calc_deflections(const Point2& point_m, std::span<const Mode> modes, std::span<double> w) const {
  const double r = std::min(std::hypot(point_m[0], point_m[1]) / radius_m_, 1.0), angle = std::atan2(point_m[1], point_m[0]);
  if (std::abs(r - cached_radius_) > 1e-12) {
    cached_.assign(radials_.size(), std::nan(""));
    cached_radius_ = r;
  }
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const std::size_t place = modes[i].index[3];
    if (std::isnan(cached_[place])) {
      const Radial& radial = radials_[place];
      cached_[place] = radial.bessel * calc_j(radial.m, radial.root * r);
      if (radial.modified != 0.0) cached_[place] += radial.modified * calc_i(radial.m, radial.root * r) / calc_i(radial.m, radial.root);
      if (!is_plate_ && r == 1.0) cached_[place] = 0.0;
    }
    const double turned = modes[i].index[0] * angle;
    w[i] = cached_[place] * (modes[i].index[2] == 0 ? std::cos(turned) : std::sin(turned));
  }
}

/// Integration by parts, since w = 0 at the rim: integral of -w_i times the Laplacian of w_j, of equal m and part.
la::Matrix Circle::calc_slope_products(std::span<const Mode> modes) const {
  const auto count = static_cast<Eigen::Index>(modes.size());
  la::Matrix products = la::Matrix::Zero(count, count);
  double largest = 1.0;
  for (const Mode& mode : modes) largest = std::max(largest, radials_[mode.index[3]].root);
  const GaussRule rule = make_gauss_rule(30 + static_cast<int>(largest));
  la::Matrix w(static_cast<Eigen::Index>(rule.x.size()), count), bent = w;
  for (Eigen::Index j = 0; j < count; ++j) {
    const Radial& radial = radials_[modes[j].index[3]];
    for (std::size_t k = 0; k < rule.x.size(); ++k) {
      const double j_part = radial.bessel * calc_j(radial.m, radial.root * rule.x[k]);
      const double i_part =
          radial.modified != 0.0 ? radial.modified * calc_i(radial.m, radial.root * rule.x[k]) / calc_i(radial.m, radial.root) : 0.0;
      w(static_cast<Eigen::Index>(k), j) = j_part + i_part;
      bent(static_cast<Eigen::Index>(k), j) = rule.weight[k] * rule.x[k] * square(radial.root) * (j_part - i_part);
    }
  }
  for (Eigen::Index j = 0; j < count; ++j)
    for (Eigen::Index i = 0; i <= j; ++i) {
      const auto &one = modes[i].index, &other = modes[j].index;
      if (one[0] != other[0] || one[2] != other[2]) continue;
      products(i, j) = products(j, i) = (one[0] == 0 ? 2.0 : 1.0) * pi * w.col(i).dot(bent.col(j));
    }
  return products;
}

Net Circle::make_net(int grid) const { return make_disc_net(radius_m_, std::max(1, grid / 2)); }

int Circle::choose_grid(std::span<const Mode> modes) const {
  double root = 1.0;
  for (const Mode& mode : modes) root = std::max(root, radials_[mode.index[3]].root);
  return choose_flat_grid(2.0 * root / pi);
}

}  // namespace carillon::analytic
