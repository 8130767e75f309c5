// Method:     an under-damped mode is z = (q' + d q) + i omega_d q, so z(t + h) = e^{(-d + i omega_d) h} z(t), and its pressure g q' = Re(w
//             z), w = g (1 + i d / omega_d). Tables are computed from exponentials in double precision, not from repeated products. Modes
//             are sorted by the time after which the reference strike is inaudible, so the audible ones are always the first ones.
// Source:     docs/equations.md E4; docs/decisions/resonator-kernel.md.
// Deviations: the audible band is tested with sqrt(lambda), not the damped frequency, which would drop over-damped modes.
#include "runtime/synth/model.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstring>
#include <limits>
#include <numbers>
#include <type_traits>
#include <unordered_map>
#include <utility>

#include "runtime/acoustics/radiation/transfers.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/large.hpp"
#include "runtime/synth/bending.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/nonlinear_modes.hpp"
#include "runtime/synth/oscillator.hpp"

namespace carillon::synth {
namespace {

// Relative distance from critical damping below which q' = re - (d / omega_d) im loses digits.
constexpr double kNearCritical = 0.05;
// Largest |root| x step that kMoments Chebyshev terms resolve.
constexpr double kStiffest = 4.0;
// A root that decays within 1/1024 of a sample is not rendered.
constexpr int kMaxSubsteps = 256;

bool is_positive(double x) { return std::isfinite(x) && x > 0.0; }

void check(const bank::Bank& bank, const ModelOptions& options) {
  const std::size_t m = bank.mode_count();
  if (bank.decay_per_s.size() != m || bank.radiation_gain.size() != m || bank.shape_scale.size() != m ||
      bank.shape.size() != bank.vertex_count() * m * 3) {
    throw InputError("mode bank: its arrays disagree in length; make the bank again with carillon-precompute");
  }
  for (const auto& triangle : bank.triangles) {
    for (const std::int32_t vertex : triangle) {
      if (vertex < 0 || static_cast<std::size_t>(vertex) >= bank.vertex_count()) {
        throw InputError("mode bank: a triangle names a vertex that does not exist; make the bank again with carillon-precompute");
      }
    }
  }
  if (!is_positive(options.rate_hz)) throw InputError("the sample rate must be a positive number of Hz");
  if (!is_positive(options.reference_impulse_n_s)) throw InputError("the reference impulse must be a positive number of N s");
  if (!is_positive(options.silence_pa)) throw InputError("silence_pa must be a positive number");
  if (!std::isfinite(options.sphere_radius_m) || options.sphere_radius_m < 0.0)
    throw InputError("the radius of the body's sphere must be a number of m, 0 or more");
  if (!options.gains.empty() && options.gains.size() != m) throw InputError("gains and modes of the bank differ in number");
  if (options.transfers != nullptr && static_cast<std::size_t>(options.transfers->get_mode_count()) != m)
    throw InputError("transfers and modes of the bank differ in number");
}

/// Zeroes an array of tables, so that empty lanes are silent.
template <typename T>
void add_zero(std::vector<T>& tables) {
  tables.push_back(T{});
}

}  // namespace

std::shared_ptr<const Model> Model::make(const bank::Bank& bank, const ModelOptions& options) {
  check(bank, options);
  struct Sorted {
    Mode mode;
    double level;    // of the reference strike over silence, in nepers
    double heard_s;  // audible time
  };
  std::vector<Sorted> ringing;
  std::vector<Mode> damped;
  const double nyquist_rad_s = std::numbers::pi * options.rate_hz;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const double omega = std::sqrt(bank.eigenvalue_rad2_s2[m]);
    if (!(omega < nyquist_rad_s)) continue;
    const Mode mode{.lambda = bank.eigenvalue_rad2_s2[m],
                    .decay = bank.decay_per_s[m],
                    .gain = options.gains.empty() ? bank.radiation_gain[m] : options.gains[m],
                    .scale = bank.shape_scale[m],
                    .bank_mode = static_cast<int>(m)};
    if (mode.decay < omega * std::sqrt(1.0 - kNearCritical * kNearCritical)) {
      const double pressure = std::abs(mode.gain) * mode.scale * 32767.0 * options.reference_impulse_n_s;
      const double level = std::log(std::max(pressure / options.silence_pa, std::numeric_limits<double>::min()));
      ringing.push_back({mode, level, level > 0.0 ? level / std::max(mode.decay, 1e-9) : 0.0});
    } else {
      damped.push_back(mode);
    }
  }
  std::stable_sort(ringing.begin(), ringing.end(),
                   [](const Sorted& a, const Sorted& b) { return a.heard_s != b.heard_s ? a.heard_s > b.heard_s : a.level > b.level; });
  if (options.like != nullptr) {  // modes missing in that model come last
    std::unordered_map<int, int> place;
    for (int m = 0; m < options.like->get_ringing_mode_count(); ++m) place.emplace(options.like->get_bank_mode(m), m);
    const auto find_place = [&](const Sorted& sorted) {
      const auto found = place.find(sorted.mode.bank_mode);
      return found != place.end() ? found->second : std::numeric_limits<int>::max();
    };
    std::stable_sort(ringing.begin(), ringing.end(), [&](const Sorted& a, const Sorted& b) { return find_place(a) < find_place(b); });
  }
  const auto model = std::make_shared<Model>(Model());
  model->rate_hz_ = options.rate_hz;
  model->mass_kg_ = bank.rigid.mass_kg;
  model->centre_m_ = bank.rigid.centre_m;
  model->sphere_radius_m_ = options.sphere_radius_m > 0.0 ? options.sphere_radius_m
                                                          : std::cbrt(std::max(0.0, bank.rigid.volume_m3) * 3.0 / (4.0 * std::numbers::pi));
  const bank::Material& material = bank.material;
  model->plane_strain_modulus_pa_ = material.young_modulus_pa / (1.0 - material.poisson_ratio * material.poisson_ratio);
  model->wave_impedance_pa_s_m_ = bank::calc_wave_impedance(material);
  for (const Sorted& sorted : ringing) model->add_ringing_mode(sorted.mode);
  model->add_damped_modes(damped);
  if (options.like != nullptr && model->has_modes_of(*options.like) &&
      options.like->surface_->shape.size() == bank.vertex_count() * 3 * options.like->surface_->columns &&
      options.like->surface_->triangles == bank.triangles)
    model->surface_ = options.like->surface_;
  else
    model->copy_shapes(bank);
  model->find_bounds();
  model->find_bending(find_judged_thickness_m(bank));
  if (options.transfers != nullptr || !bank.multipoles.is_empty())
    model->add_directivity(options.transfers != nullptr ? options.transfers : std::make_shared<const radiation::Transfers>(bank));
  model->add_nonlinear(bank.quartic);
  return model;
}

void Model::add_ringing_mode(const Mode& mode) {
  const int lane = ringing_ % kGroup;
  if (lane == 0) {
    add_zero(sound_);
    add_zero(turn_);
    add_zero(strike_);
  }
  ++ringing_;
  modes_.push_back(mode);
  const double h = 1.0 / rate_hz_;
  const double d = mode.decay;
  const double omega = std::sqrt(mode.lambda), omega_d = calc_damped_omega(mode.lambda, d);
  const auto answer = [&](double samples) { return std::exp(-d * samples * h) * std::polar(1.0, omega_d * samples * h); };
  const std::complex<double> out(mode.gain, mode.gain * d / omega_d);
  for (int k = 0; k < kColumn; ++k) {
    const std::complex<double> wave = out * answer(k);
    sound_.back().wave[lane / 2][0][k][lane % 2] = static_cast<float>(wave.real());
    sound_.back().wave[lane / 2][1][k][lane % 2] = static_cast<float>(-wave.imag());
  }
  RotationTable& turn = turn_.back();
  // The angle per block accumulates while the mode sounds: half a unit of double precision becomes audible after hours.
  using Exact = long double;
  const Exact exact_d = d, exact_omega = std::sqrt(static_cast<Exact>(mode.lambda)), period = kBlock / static_cast<Exact>(rate_hz_);
  const Exact angle = std::sqrt((exact_omega - exact_d) * (exact_omega + exact_d)) * period, size = std::exp(-exact_d * period);
  turn.block_re[lane] = static_cast<double>(size * std::cos(angle));
  turn.block_im[lane] = static_cast<double>(size * std::sin(angle));
  for (int i = 0; i < 3; ++i) {
    turn.columns_re[i][lane] = static_cast<float>(answer(kColumn << i).real());
    turn.columns_im[i][lane] = static_cast<float>(answer(kColumn << i).imag());
  }
  StrikeTable& strike = strike_.back();
  strike.turn_re[lane] = static_cast<float>(answer(1.0).real());
  strike.turn_im[lane] = static_cast<float>(answer(1.0).imag());
  strike.out_re[lane] = static_cast<float>(out.real());
  strike.out_im[lane] = static_cast<float>(-out.imag());
  strike.scale[lane] = static_cast<float>(mode.scale);
  strike.angle[lane] = static_cast<float>(omega * h);
  const auto points = get_chebyshev_points();
  std::array<double, kMoments> re{}, im{};
  for (int k = 0; k < kMoments; ++k) {
    re[k] = answer(1.0 - points[k]).real();
    im[k] = answer(1.0 - points[k]).imag();
  }
  const Moments cre = calc_chebyshev_coefficients(re);
  const Moments cim = calc_chebyshev_coefficients(im);
  for (int j = 0; j < kTerms; ++j) {
    strike.force_re[j][lane] = static_cast<float>(cre[j]);
    strike.force_im[j][lane] = static_cast<float>(cim[j]);
  }
}

ForceAnswer calc_force_answer(const nonlinear::ModeConstants& mode, double rate_hz) {
  const double d = mode.decay_per_s, omega_d = calc_damped_omega(mode.eigenvalue_rad2_s2, d);
  const auto points = get_chebyshev_points();
  Moments re{}, im{};
  for (int k = 0; k < kMoments; ++k) {
    const double age = (1.0 - points[k]) / rate_hz;
    re[k] = std::exp(-d * age) * std::cos(omega_d * age);
    im[k] = std::exp(-d * age) * std::sin(omega_d * age);
  }
  return {calc_chebyshev_coefficients(re), calc_chebyshev_coefficients(im)};
}

bool Model::has_cascade() const {
  return nonlinear_ != nullptr && nonlinear_->energy.thickness_m > 0.0 && mass_kg_ > 0.0 && !nonlinear_->above.empty();
}

/// Leaves out modes that do not ring or are above the Nyquist frequency.
void Model::add_nonlinear(const bank::QuarticEnergy& energy) {
  if (energy.is_empty()) return;
  std::vector<std::pair<std::size_t, int>> ringing;  // number in the bank, here
  for (int m = 0; m < ringing_; ++m) ringing.emplace_back(static_cast<std::size_t>(get_bank_mode(m)), m);
  std::sort(ringing.begin(), ringing.end());
  std::vector<std::size_t> numbers;
  for (const auto& [number, mode] : ringing) numbers.push_back(number);
  auto made = std::make_shared<ModelNonlinear>();
  made->energy = bank::select_coupled(energy, numbers);
  if (made->energy.is_empty()) return;
  made->strike = strike_;
  for (const std::int32_t place : made->energy.modes) {
    const int m = ringing[place].second;
    const Mode& mode = modes_[m];
    made->mode.push_back(m);
    made->constants.push_back({mode.lambda, mode.decay});
    made->groups = std::max(made->groups, m / kGroup + 1);
    made->strike[m / kGroup].scale[m % kGroup] = 0.0F;
    made->answer.push_back(calc_force_answer({mode.lambda, mode.decay}, rate_hz_));
  }
  double highest = 0.0;
  for (const nonlinear::ModeConstants& mode : made->constants) highest = std::max(highest, mode.eigenvalue_rad2_s2);
  for (int m = 0; m < ringing_; ++m)
    if (modes_[m].lambda > highest) made->above.push_back(m);
  std::sort(made->above.begin(), made->above.end(), [this](int a, int b) { return modes_[a].lambda < modes_[b].lambda; });
  nonlinear_ = made;
}

void Model::add_damped_modes(const std::vector<Mode>& modes) {
  std::vector<std::pair<Mode, DampedMode>> made;
  const double h = 1.0 / rate_hz_;
  for (const Mode& mode : modes) {
    const double d = mode.decay;
    const double omega = std::sqrt(mode.lambda);
    const double root = d > omega ? std::sqrt((d - omega) * (d + omega)) : 0.0;
    const double fastest = d > omega ? d + root : omega;
    int substeps = 1;
    while (fastest * h / substeps > kStiffest && substeps < kMaxSubsteps) substeps *= 2;
    const bool follows = fastest * h / substeps > kStiffest;
    if (follows) substeps = 1;
    DampedMode m{};
    const OscillatorMap full = calc_oscillator_map(mode.lambda, d, h);
    const OscillatorMap sub = calc_oscillator_map(mode.lambda, d, h / substeps);
    m.qq = full.qq, m.qv = full.qv, m.vq = full.vq, m.vv = full.vv;
    m.sub_qq = sub.qq, m.sub_qv = sub.qv, m.sub_vq = sub.vq, m.sub_vv = sub.vv;
    const auto points = get_chebyshev_points();
    std::array<double, kMoments> q{}, v{};
    for (int k = 0; k < kMoments; ++k) {
      const double age = (1.0 - points[k]) * h / substeps;
      const OscillatorMap part = calc_oscillator_map(mode.lambda, d, age);
      q[k] = follows ? std::exp(-mode.lambda / fastest * age) : part.qv;
      v[k] = follows ? 0.0 : part.vv;
    }
    m.force_q = calc_chebyshev_coefficients(q);
    m.force_v = calc_chebyshev_coefficients(v);
    m.gain = mode.gain;
    m.bound = root > 0.0 ? std::min(2.0 * omega, mode.lambda / (2.0 * root)) : 2.0 * omega;
    m.scale = mode.scale;
    m.fast = fastest;
    m.slow = mode.lambda / fastest;
    m.substeps = follows ? 0 : substeps;
    made.emplace_back(mode, m);
  }
  std::stable_sort(made.begin(), made.end(), [](const auto& a, const auto& b) { return a.second.substeps < b.second.substeps; });
  for (const auto& [mode, m] : made) {
    modes_.push_back(mode);
    damped_.push_back(m);
  }
}

/// At least one, so that the rows of a body without modes differ: sensors find vertices by them.
static std::size_t count_columns(std::size_t groups, std::size_t damped) { return std::max<std::size_t>(groups * kGroup + damped, 1); }

/// True for the same modes in the same order.
bool Model::has_modes_of(const Model& other) const {
  return ringing_ == other.ringing_ && std::equal(modes_.begin(), modes_.end(), other.modes_.begin(), other.modes_.end(),
                                                  [](const Mode& a, const Mode& b) { return a.bank_mode == b.bank_mode; });
}

void Model::copy_shapes(const bank::Bank& bank) {
  const auto surface = std::make_shared<ModelSurface>();
  surface_ = surface;
  surface->triangles = bank.triangles;
  const std::size_t columns = surface->columns = count_columns(sound_.size(), damped_.size());
  base::reserve_large(surface->shape, bank.vertex_count() * 3 * columns);
  std::vector<std::int16_t> row(3 * columns, 0);  // of a vertex; empty lanes stay 0
  std::vector<std::uint32_t> first, column;       // per mode: column in a vertex's row of the bank, and here
  for (std::size_t i = 0; i < modes_.size(); ++i) {
    first.push_back(3 * static_cast<std::uint32_t>(modes_[i].bank_mode));
    column.push_back(static_cast<std::uint32_t>(
        i < static_cast<std::size_t>(ringing_) ? i : sound_.size() * kGroup + i - static_cast<std::size_t>(ringing_)));
  }
  std::vector<float>& largest = surface->largest;
  largest.assign(sound_.size() * kGroup, 0.0F);
  for (std::size_t vertex = 0; vertex < bank.vertex_count(); ++vertex) {
    const std::int16_t* from = bank.get_steps(vertex);
    std::int16_t *x = row.data(), *y = x + columns, *z = y + columns;
    for (std::size_t i = 0; i < modes_.size(); ++i) {
      x[column[i]] = from[first[i]];
      y[column[i]] = from[first[i] + 1];
      z[column[i]] = from[first[i] + 2];
    }
    surface->shape.insert(surface->shape.end(), row.begin(), row.end());
    for (std::size_t c = 0; c < largest.size(); ++c) {
      const auto fx = static_cast<float>(x[c]), fy = static_cast<float>(y[c]), fz = static_cast<float>(z[c]);
      largest[c] = std::max(largest[c], fx * fx + fy * fy + fz * fz);
    }
  }
}

void Model::find_bounds() {
  weight_.resize(sound_.size());
  reach_.resize(sound_.size());
  float largest = 0.0F;
  for (std::size_t g = sound_.size(); g-- > 0;) {
    const float* size = &surface_->largest[g * kGroup];
    float reach = 0.0F;
    for (std::size_t lane = 0; lane < kGroup; ++lane) {
      weight_[g][lane] = std::hypot(strike_[g].out_re[lane], strike_[g].out_im[lane]);
      reach += weight_[g][lane] * strike_[g].scale[lane] * std::sqrt(size[lane]);
    }
    largest = std::max(largest, reach);
    reach_[g] = largest;
  }
}

void Model::find_bending(double thickness_m) {
  constexpr std::size_t kLowest = 32, kSpread = 96;  // modes, vertices
  constexpr double kShortestS = 0.08;
  bending_ = {};
  const std::size_t columns = surface_->columns;
  if (!(thickness_m > 0.0) || columns == 0 || modes_.empty()) return;
  bending_.thickness_m = thickness_m;
  bending_.step_m.assign(columns, 0.0F);
  bending_.largest.assign(columns, 0.0F);
  const std::size_t lanes = sound_.size() * kGroup;
  bending_.back_re.assign(ModelBending::kBack * lanes, 0.0F);
  bending_.back_im.assign(ModelBending::kBack * lanes, 0.0F);
  const std::size_t vertices = surface_->shape.size() / (3 * columns);
  const auto set = [&](std::size_t column, double step_m, double largest) {
    bending_.step_m[column] = static_cast<float>(step_m);
    bending_.largest[column] = static_cast<float>(std::sqrt(largest) * (1.0 + 1e-6));
  };
  std::vector<std::size_t> order;
  for (std::size_t m = 0; m < static_cast<std::size_t>(ringing_); ++m) {
    const double omega = std::sqrt(modes_[m].lambda), omega_d = std::sqrt((omega - modes_[m].decay) * (omega + modes_[m].decay));
    set(m, modes_[m].scale / omega_d, static_cast<double>(surface_->largest[m]));
    for (std::size_t k = 0; k < ModelBending::kBack; ++k) {
      const double back_s = ModelBending::kBackSamples * static_cast<double>(k + 1) / rate_hz_;
      const std::complex<double> turn = std::exp(modes_[m].decay * back_s) * std::polar(1.0, -omega_d * back_s);
      bending_.back_re[k * lanes + m] = static_cast<float>(turn.real());
      bending_.back_im[k * lanes + m] = static_cast<float>(turn.imag());
    }
    order.push_back(m);
  }
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return modes_[a].lambda < modes_[b].lambda; });
  double longest_s = kShortestS;
  if (!order.empty()) longest_s = std::max(longest_s, std::numbers::pi / std::sqrt(modes_[order.front()].lambda));
  bending_.watched = static_cast<int>(std::min(longest_s * rate_hz_ / kSubBlock + 1.0, 1e9));
  order.resize(std::min(order.size(), kLowest));
  for (std::size_t m = 0; m < damped_.size(); ++m) order.push_back(get_damped_column(m));
  // Antinodes, row by row: shapes are stored by vertex.
  std::vector<double> most(order.size(), -1.0);
  std::vector<std::int32_t> antinode(order.size(), 0);
  for (std::size_t v = 0; v < vertices; ++v) {
    const auto vertex = static_cast<std::int32_t>(v);
    const std::array rows{get_row(vertex, 0), get_row(vertex, 1), get_row(vertex, 2)};
    for (std::size_t k = 0; k < order.size(); ++k) {
      double square = 0.0;
      for (const std::int16_t* row : rows) square += static_cast<double>(row[order[k]]) * row[order[k]];
      if (square > most[k]) most[k] = square, antinode[k] = vertex;
    }
  }
  const std::size_t ringing = order.size() - damped_.size();
  for (std::size_t m = 0; m < damped_.size(); ++m) set(get_damped_column(m), damped_[m].scale, most[ringing + m]);
  bending_.vertex.assign(antinode.begin(), antinode.begin() + static_cast<std::ptrdiff_t>(ringing));
  for (std::size_t v = 0; v < vertices; v += std::max<std::size_t>(1, vertices / kSpread))
    bending_.vertex.push_back(static_cast<std::int32_t>(v));
  std::sort(bending_.vertex.begin(), bending_.vertex.end());
  bending_.vertex.erase(std::unique(bending_.vertex.begin(), bending_.vertex.end()), bending_.vertex.end());
}

void Model::add_directivity(std::shared_ptr<const radiation::Transfers> transfers) {
  // A mode of order L is at most L + 1 times as loud as its rms over directions (addition theorem); no bank examined exceeded four times.
  constexpr double kMostFocused = 4.0;
  const auto made = std::make_shared<ModelDirectivity>();
  made->sound.resize(sound_.size());
  made->weight.resize(sound_.size());
  made->reach.resize(sound_.size());
  made->offset_m = transfers->get_centre_m() - centre_m_;
  for (SoundTable& table : made->sound) table = SoundTable{};
  for (int m = 0; m < ringing_; ++m) {
    const Mode& mode = modes_[m];
    const std::size_t group = m / kGroup;
    const int lane = m % kGroup;
    const double omega = std::sqrt(mode.lambda), omega_d = std::sqrt((omega - mode.decay) * (omega + mode.decay));
    for (int k = 0; k < kColumn; ++k) {
      const double h = k / rate_hz_;
      const std::complex<double> wave = std::exp(-mode.decay * h) * std::polar(1.0, omega_d * h);
      made->sound[group].wave[lane / 2][0][k][lane % 2] = static_cast<float>(wave.real());
      made->sound[group].wave[lane / 2][1][k][lane % 2] = static_cast<float>(-wave.imag());
    }
    const double focus = std::min(kMostFocused, transfers->get_order(mode.bank_mode) + 1.0);
    made->tilt.push_back(static_cast<float>(mode.decay / omega_d));
    made->level.push_back(1.0F);
    made->weight[group][lane] = static_cast<float>(focus * transfers->get_rms(mode.bank_mode) * std::hypot(1.0, mode.decay / omega_d));
  }
  float largest = 0.0F;
  for (std::size_t g = sound_.size(); g-- > 0;) {
    float reach = 0.0F;
    for (std::size_t lane = 0; lane < kGroup; ++lane) {
      made->weight[g][lane] = std::max(made->weight[g][lane], weight_[g][lane]);
      reach += made->weight[g][lane] * strike_[g].scale[lane] * std::sqrt(surface_->largest[g * kGroup + lane]);
    }
    largest = std::max(largest, reach);
    made->reach[g] = largest;
  }
  made->transfers = std::move(transfers);
  directivity_ = made;
}

std::shared_ptr<const Model> Model::make_solo(const Model& of, int bank_mode) {
  const auto model = std::make_shared<Model>(Model(of));
  // weight_ and reach_ stay: muted modes are culled as before.
  for (int m = 0; m < of.get_mode_count(); ++m) {
    if (of.get_bank_mode(m) == bank_mode) continue;
    if (m >= of.ringing_) {
      model->damped_[m - of.ringing_].gain = 0.0;
      continue;
    }
    const std::size_t group = m / kGroup;
    const int lane = m % kGroup;
    for (int part = 0; part < 2; ++part)
      for (int k = 0; k < kColumn; ++k) model->sound_[group].wave[lane / 2][part][k][lane % 2] = 0.0F;
    model->strike_[group].out_re[lane] = model->strike_[group].out_im[lane] = 0.0F;
  }
  if (of.directivity_ == nullptr) return model;
  const auto own = std::make_shared<ModelDirectivity>(*of.directivity_);
  for (int m = 0; m < of.ringing_; ++m)
    if (of.get_bank_mode(m) != bank_mode) own->level[m] = 0.0F;
  model->directivity_ = own;
  return model;
}

namespace {

/// Writes numbers and arrays in sequence, each array preceded by its length.
class TableWriter {
 public:
  template <class Value>
  void put(const Value& value) {
    static_assert(std::is_trivially_copyable_v<Value>);
    const auto* at = reinterpret_cast<const std::byte*>(&value);
    bytes.insert(bytes.end(), at, at + sizeof(Value));
  }
  template <class Value>
  void put(const std::vector<Value>& values) {
    static_assert(std::is_trivially_copyable_v<Value>);
    put(static_cast<std::uint64_t>(values.size()));
    const auto* at = reinterpret_cast<const std::byte*>(values.data());
    bytes.insert(bytes.end(), at, at + values.size() * sizeof(Value));
  }
  std::vector<std::byte> bytes;
};

class TableReader {
 public:
  explicit TableReader(std::span<const std::byte> bytes) : left_(bytes) {}
  template <class Value>
  void take(Value& value) {
    std::memcpy(&value, take_bytes(sizeof(Value)), sizeof(Value));
  }
  template <class Value>
  void take(std::vector<Value>& values) {
    std::uint64_t count = 0;
    take(count);
    if (count > left_.size() / sizeof(Value)) refuse();
    values.resize(count);
    const std::byte* from = take_bytes(values.size() * sizeof(Value));
    if (!values.empty()) std::memcpy(values.data(), from, values.size() * sizeof(Value));
  }
  bool is_at_end() const { return left_.empty(); }
  [[noreturn]] static void refuse() { throw InputError("not a model of this build"); }

 private:
  const std::byte* take_bytes(std::size_t count) {
    if (count > left_.size()) refuse();
    const std::byte* at = left_.data();
    left_ = left_.subspan(count);
    return at;
  }
  std::span<const std::byte> left_;
};

// Build identification: other table layouts have other sizes, or another number here.
constexpr std::uint64_t kTablesMark = 0x63617272'00000003 + (sizeof(SoundTable) << 8) + (sizeof(StrikeTable) << 16);

}  // namespace

std::vector<std::byte> Model::write_tables() const {
  TableWriter writer;
  writer.put(kTablesMark);
  writer.put(rate_hz_);
  writer.put(mass_kg_);
  writer.put(sphere_radius_m_);
  writer.put(bending_.thickness_m);
  writer.put(plane_strain_modulus_pa_);
  writer.put(wave_impedance_pa_s_m_);
  writer.put(static_cast<std::int64_t>(ringing_));
  writer.put(modes_);
  writer.put(sound_);
  writer.put(turn_);
  writer.put(strike_);
  writer.put(weight_);
  writer.put(reach_);
  writer.put(damped_);
  return std::move(writer.bytes);
}

std::shared_ptr<const Model> Model::read_tables(std::span<const std::byte> bytes, std::shared_ptr<const ModelSurface> surface) {
  TableReader reader(bytes);
  std::uint64_t mark = 0;
  reader.take(mark);
  if (mark != kTablesMark || surface == nullptr) TableReader::refuse();
  const auto model = std::make_shared<Model>(Model());
  std::int64_t ringing = 0;
  reader.take(model->rate_hz_);
  reader.take(model->mass_kg_);
  reader.take(model->sphere_radius_m_);
  double thickness_m = 0.0;
  reader.take(thickness_m);
  reader.take(model->plane_strain_modulus_pa_);
  reader.take(model->wave_impedance_pa_s_m_);
  reader.take(ringing);
  reader.take(model->modes_);
  reader.take(model->sound_);
  reader.take(model->turn_);
  reader.take(model->strike_);
  reader.take(model->weight_);
  reader.take(model->reach_);
  reader.take(model->damped_);
  const std::size_t groups = model->sound_.size();
  const bool agrees = ringing >= 0 && static_cast<std::size_t>(ringing) <= groups * kGroup && (groups == 0 || ringing > 0) &&
                      model->modes_.size() == static_cast<std::size_t>(ringing) + model->damped_.size() && model->turn_.size() == groups &&
                      model->strike_.size() == groups && model->weight_.size() == groups && model->reach_.size() == groups &&
                      reader.is_at_end() && surface->columns == count_columns(groups, model->damped_.size());
  if (!agrees) TableReader::refuse();
  const std::size_t vertices = surface->columns > 0 ? surface->shape.size() / (3 * surface->columns) : 0;
  for (const auto& triangle : surface->triangles)
    for (const std::int32_t vertex : triangle)
      if (vertex < 0 || (surface->columns > 0 && static_cast<std::size_t>(vertex) >= vertices)) TableReader::refuse();
  model->ringing_ = static_cast<int>(ringing);
  model->surface_ = std::move(surface);
  model->find_bending(thickness_m);
  return model;
}

double Model::calc_projection(int mode, std::int32_t triangle, const Vec3& barycentric, const Vec3& direction) const {
  if (!has_triangle(triangle)) throw InputError("the bank has no such triangle");
  const int column = mode < ringing_ ? mode : static_cast<int>(sound_.size()) * kGroup + mode - ringing_;
  double sum = 0.0;
  for (std::size_t corner = 0; corner < 3; ++corner) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sum += barycentric[corner] * direction[axis] * get_row(surface_->triangles[triangle][corner], static_cast<int>(axis))[column];
    }
  }
  return sum * modes_[mode].scale;
}

namespace {

std::size_t calc_nonlinear_bytes(const ModelNonlinear& nonlinear) {
  const bank::QuarticEnergy& energy = nonlinear.energy;
  const auto count = [](const auto& list) { return list.size() * sizeof(list[0]); };
  return count(energy.modes) + count(energy.rows) + count(energy.gradient) + count(energy.stress) + count(energy.weight) +
         count(energy.linear) + count(nonlinear.mode) + count(nonlinear.constants) + count(nonlinear.answer) + count(nonlinear.strike) +
         count(nonlinear.above);
}

}  // namespace

std::size_t Model::calc_bytes() const {
  return sound_.size() * (sizeof(SoundTable) + sizeof(RotationTable) + sizeof(StrikeTable) + sizeof(weight_[0]) + sizeof(reach_[0])) +
         damped_.size() * sizeof(DampedMode) + modes_.size() * sizeof(Mode) + surface_->triangles.size() * sizeof(surface_->triangles[0]) +
         surface_->shape.size() * sizeof(surface_->shape[0]) + surface_->largest.size() * sizeof(surface_->largest[0]) +
         (bending_.step_m.size() + bending_.largest.size() + 2 * bending_.back_re.size()) * sizeof(float) +
         bending_.vertex.size() * sizeof(std::int32_t) + (nonlinear_ ? calc_nonlinear_bytes(*nonlinear_) : 0) +
         (directivity_
              ? directivity_->sound.size() * (sizeof(SoundTable) + sizeof(weight_[0]) + sizeof(reach_[0])) +
                    (directivity_->tilt.size() + directivity_->level.size()) * sizeof(float) + directivity_->transfers->calc_bytes()
              : 0);
}

}  // namespace carillon::synth
