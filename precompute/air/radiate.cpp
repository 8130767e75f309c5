// Method:     power from the multipoles, since the surface integral of p v* can cancel; added mass from the surface integral of p v. A
//   reflecting plane: the body and its mirror image, moving in phase.
// Source:     docs/equations.md E10.
#include "precompute/air/radiate.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "precompute/air/expansion.hpp"
#include "precompute/air/solve.hpp"
#include "precompute/air/transfer.hpp"
#include "runtime/bank/mixing.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/base/descriptor.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::air {
namespace {

using Double = std::complex<double>;

/// Append-only file of answers, each with its own checksum; complete answers are read again after a crash. Invariant: all answers have the
/// same radiator and settings. Rank 0 only.
class AnswersFile {
 public:
  /// `fingerprint`: hash of radiator and settings. A mismatched or corrupt file is treated as empty.
  AnswersFile(std::filesystem::path file, const std::array<unsigned char, 32>& fingerprint);

  /// In the order of save().
  std::vector<WaveAnswer> read() const;
  /// Throws SystemError when the write fails.
  void save(const WaveAnswer& answer);
  /// Removes the file.
  void remove();

 private:
  std::filesystem::path file_;
  std::array<unsigned char, 32> fingerprint_{};
  std::size_t whole_bytes_ = 0;  // 0: missing or mismatched file
};

constexpr std::string_view kMagic = "carillon answers 2\n";
constexpr std::size_t kHead = kMagic.size() + 32, kHashBytes = 32;
constexpr std::uint64_t kMostNumbers = 100'000'000;

std::string read_bytes(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

[[noreturn]] void refuse(const std::filesystem::path& file, int error) {
  throw SystemError(fmt::format("{}: cannot be written: {}", file.string(), std::strerror(error)));
}

/// Complete answers in order and the end of the last one; 0 if the fingerprint differs.
std::pair<std::vector<WaveAnswer>, std::size_t> parse(std::string_view bytes, std::string_view fingerprint) {
  std::vector<WaveAnswer> answers;
  if (bytes.size() < kHead || !bytes.starts_with(kMagic) || bytes.substr(kMagic.size(), 32) != fingerprint) return {answers, 0};
  std::size_t at = kHead;
  while (bytes.size() - at >= sizeof(std::uint64_t)) {
    std::uint64_t count = 0;
    std::memcpy(&count, bytes.data() + at, sizeof count);
    if (count > kMostNumbers || bytes.size() - at < sizeof count + count * sizeof(double) + kHashBytes) break;
    const std::string_view record = bytes.substr(at, sizeof count + count * sizeof(double));
    const base::Sha256::Hash hash = base::calc_sha256(record);
    if (std::memcmp(hash.data(), bytes.data() + at + record.size(), kHashBytes) != 0) break;
    std::vector<double> numbers(count);
    std::memcpy(numbers.data(), record.data() + sizeof count, count * sizeof(double));
    std::optional<WaveAnswer> answer = unpack(numbers);
    if (!answer) break;
    answers.push_back(*std::move(answer));
    at += record.size() + kHashBytes;
  }
  return {std::move(answers), at};
}

std::string_view view(const std::array<unsigned char, 32>& fingerprint) {
  return {reinterpret_cast<const char*>(fingerprint.data()), fingerprint.size()};
}

AnswersFile::AnswersFile(std::filesystem::path file, const std::array<unsigned char, 32>& fingerprint)
    : file_(std::move(file)), fingerprint_(fingerprint), whole_bytes_(parse(read_bytes(file_), view(fingerprint_)).second) {}

std::vector<WaveAnswer> AnswersFile::read() const { return parse(read_bytes(file_), view(fingerprint_)).first; }

void AnswersFile::save(const WaveAnswer& answer) {
  const bool is_new = whole_bytes_ == 0;
  const base::Descriptor descriptor(::open(file_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666));
  if (descriptor.get() < 0) refuse(file_, errno);
  // Drop an incomplete answer of a run that was killed while writing.
  if (::ftruncate(descriptor.get(), static_cast<off_t>(whole_bytes_)) != 0 || ::lseek(descriptor.get(), 0, SEEK_END) < 0)
    refuse(file_, errno);
  const std::vector<double> numbers = pack(answer);
  const std::uint64_t count = numbers.size();
  std::string record(sizeof count + count * sizeof(double), '\0');
  std::memcpy(record.data(), &count, sizeof count);
  std::memcpy(record.data() + sizeof count, numbers.data(), count * sizeof(double));
  const base::Sha256::Hash hash = base::calc_sha256(record);
  record.append(reinterpret_cast<const char*>(hash.data()), hash.size());
  if (is_new) record.insert(0, std::string(kMagic) + std::string(view(fingerprint_)));
  if (const int error = base::write_all(descriptor.get(), record); error != 0) refuse(file_, error);
  if (::fdatasync(descriptor.get()) != 0) refuse(file_, errno);
  whole_bytes_ += record.size();
}

void AnswersFile::remove() {
  std::error_code ignored;  // a missing file is no error
  std::filesystem::remove(file_, ignored);
  whole_bytes_ = 0;
}

/// Hash of the radiator, the options and the program version that determine the answers.
std::array<unsigned char, 32> calc_fingerprint(const Radiator& radiator, const AirSolveOptions& options) {
  base::Sha256 hash;
  const auto add = [&](const auto& values) { hash.add(std::as_bytes(std::span(values))); };
  hash.add(kMagic);
  add(radiator.nodes_m);
  add(radiator.triangles);
  add(radiator.velocity);
  add(radiator.wave_number_1_m);
  const CouplingOptions coupling = options.coupling.value_or(CouplingOptions{});
  const std::array<double, 11> numbers{options.step,
                                       options.error_db,
                                       options.nearest_over_radius,
                                       options.tolerance,
                                       radiator.sphere.radius_m,
                                       static_cast<double>(radiator.rigid),
                                       coupling.has_rows ? 1.0 : 0.0,
                                       coupling.density_kg_m3,
                                       coupling.kept,
                                       static_cast<double>(radiator.nodes_m.size()),
                                       static_cast<double>(radiator.triangles.size())};
  add(numbers);
  add(radiator.sphere.centre_m);
  return hash.finish();
}

constexpr double kNearTop = 0.7;  // of the highest frequency: above it, missing modes beyond the band may mix in

/// Mirrors a point at the plane.
Vec3 mirror(const Plane& plane, const Vec3& place) { return place - (2.0 * dot(place - plane.point_m, plane.normal)) * plane.normal; }

/// Appends the mirror image, moving in phase: again a closed surface.
void add_mirror_image(const Plane& plane, Radiator& radiator) {
  const std::size_t nodes = radiator.nodes_m.size(), facets = radiator.triangles.size(), row = radiator.count_motions();
  for (std::size_t i = 0; i < nodes; ++i) {
    if (!(dot(radiator.nodes_m[i] - plane.point_m, plane.normal) > 0.0))
      throw InputError("\"half_space\": part of the body is behind the plane; move the plane, or reverse its normal");
    radiator.nodes_m.push_back(mirror(plane, radiator.nodes_m[i]));
  }
  const auto shift = static_cast<std::int32_t>(nodes);
  for (std::size_t t = 0; t < facets; ++t) {
    const auto [a, b, c] = radiator.triangles[t];
    radiator.triangles.push_back({a + shift, c + shift, b + shift});
    for (const std::size_t corner : {0U, 2U, 1U})
      for (std::size_t m = 0; m < row; ++m) radiator.velocity.push_back(radiator.velocity[(t * 3 + corner) * row + m]);
  }
  radiator.sphere = find_enclosing_sphere(radiator.nodes_m);
}

/// Edge length of an equilateral triangle of the mean facet area.
void check_facets(const Radiator& radiator, const AirOptions& options) {
  double area = 0.0;
  for (const auto& [a, b, c] : radiator.triangles)
    area += 0.5 * norm(cross(radiator.nodes_m[b] - radiator.nodes_m[a], radiator.nodes_m[c] - radiator.nodes_m[a]));
  const double edge = std::sqrt(area / static_cast<double>(radiator.triangles.size()) * 4.0 / std::sqrt(3.0));
  const double k =
      radiator.wave_number_1_m.empty() ? 0.0 : *std::max_element(radiator.wave_number_1_m.begin(), radiator.wave_number_1_m.end());
  const double facets = 2.0 * std::numbers::pi / (k * edge);
  if (!(facets < kFewFacets)) return;
  const auto wanted = std::ceil(static_cast<double>(radiator.nodes_m.size()) * kFewFacets * kFewFacets / (facets * facets));
  const std::string text = fmt::format(
      "the surface of {} nodes is too coarse for the air at {:.0f} Hz: {:.1f} facets per wavelength; give "
      "\"radiation\" a \"skin_nodes\" of {:.0f} or more, and the body a mesh as fine, or end the band lower",
      radiator.nodes_m.size(), k * options.sound_speed_ms / (2.0 * std::numbers::pi), facets, wanted);
  if (facets < kFewestFacets) throw InputError(text);
  if (options.warn) options.warn(text);
}

/// [l]: squared share of the orders above l; the larger of far field and nearest distance.
std::vector<double> calc_tail(const Sounding& mode, const Spread& spread) {
  std::vector<double> tail(spread.far.size());
  for (const std::vector<double>* counts : {&spread.far, &spread.near}) {
    std::vector<double> above(tail.size());
    double sum = 0.0;
    for (std::size_t l = tail.size(); l-- > 0;) {
      above[l] = sum;
      for (std::size_t i = l * l; i < (l + 1) * (l + 1); ++i) sum += (*counts)[l] * std::norm(mode.coefficient[i]);
    }
    for (std::size_t l = 0; l < tail.size(); ++l) tail[l] = std::max(tail[l], sum > 0.0 ? above[l] / sum : 0.0);
  }
  return tail;
}

/// Ratio of added mass to -reaction. A half space is solved with the mirror image, which doubles the reaction.
double find_density(const AirOptions& options) { return (options.half_space ? 0.5 : 1.0) * options.air_density_kg_m3; }

/// Added mass of a mode relative to its modal mass.
double calc_added_mass(const Sounding& mode, const AirOptions& options) {
  return mode.mixture.is_empty() ? -find_density(options) * mode.reaction.real() : mode.mixture.added_mass;
}

void add_mixture(const Sounding& mode, bank::Mixing& mixing) {
  if (mode.mixture.is_empty()) return;
  mixing.count.push_back(static_cast<std::int32_t>(mode.mixture.motions.size()));
  mixing.motion.insert(mixing.motion.end(), mode.mixture.motions.begin(), mode.mixture.motions.end());
  mixing.part.insert(mixing.part.end(), mode.mixture.parts.begin(), mode.mixture.parts.end());
}

/// Rigid motions that can couple to modes: those of one free body.
std::size_t count_rigid(const bank::Bank& bank) {
  return bank.counts.components == 1 && bank.counts.rigid_modes == static_cast<std::int64_t>(bank::kRigidMotions) ? bank::kRigidMotions : 0;
}

/// Rejects bodies whose motion is dominated by the air (membranes).
void check_mass(std::size_t mode, double freq_hz, double mass) {
  if (mass > kMostMass)
    throw InputError(
        fmt::format("mode {} at {:.1f} Hz: the air adds {:.2f} of its own mass: a membrane or sheet this light moves with "
                    "the air, which this method cannot solve; omit the air with \"radiation\": \"none\"",
                    mode + 1, freq_hz, mass));
}

/// Warns of modes with much added mass near the end of the band: modes beyond it, missing in the bank, would mix in.
void warn_of_band(const bank::Multipoles& multipoles, std::span<const double> freq_hz, const AirOptions& options) {
  const double top = *std::max_element(freq_hz.begin(), freq_hz.end());
  double most = 0.0, lowest = top;
  for (std::size_t m = 0; m < freq_hz.size(); ++m) {
    if (freq_hz[m] < kNearTop * top || multipoles.added_mass[m] < kCoupleMass) continue;
    most = std::max(most, multipoles.added_mass[m]);
    lowest = std::min(lowest, freq_hz[m]);
  }
  if (options.warn && most > 0.0)
    options.warn(
        fmt::format("modes from {:.4g} Hz on, near the end of the band, have an added mass of up to {:.2f}: missing modes "
                    "beyond the band would mix with them in air; end the band an octave higher",
                    lowest, most));
}

/// Appends a mode that was solved at k to a residual. The error is still a power ratio without rounding; the decay is set later.
void add_mode(const Sounding& mode, double k, double residual, const AirOptions& options, bank::Multipoles& multipoles) {
  const double radius = multipoles.radius_m, target = std::pow(10.0, options.order_db / 10.0);
  const std::vector<double> tail = calc_tail(mode, calc_spread(k, radius, multipoles.nearest_m, mode.order));
  std::size_t order = 0;
  while (order + 1 < tail.size() && tail[order] > target) ++order;
  const std::vector<Double> phase = calc_hankel_phase(k * radius, static_cast<int>(order));
  const Double by_velocity(0.0, k * options.sound_speed_ms * options.air_density_kg_m3);
  std::vector<Double> pressure;
  for (std::size_t l = 0; l <= order; ++l)
    for (std::size_t i = l * l; i < (l + 1) * (l + 1); ++i) pressure.push_back(by_velocity * phase[l] * mode.coefficient[i]);
  bank::add_coefficients(multipoles, static_cast<std::int32_t>(order), pressure);
  multipoles.freq_hz.push_back(k * options.sound_speed_ms / (2.0 * std::numbers::pi));
  multipoles.added_mass.push_back(calc_added_mass(mode, options));
  add_mixture(mode, multipoles.mixing);
  multipoles.error_db.push_back(std::pow(10.0, mode.interpolation_db / 10.0) + tail[order] + residual * residual);
}

/// Decays from the stored coefficients; errors in decibels, including far-field rounding.
void add_decays(const AirOptions& options, bank::Multipoles& multipoles) {
  const double half = options.half_space ? 0.5 : 1.0;  // the image radiates half of the power
  const std::vector<bank::CoefficientDecay> decays = bank::calc_coefficient_decays(multipoles);
  for (std::size_t m = 0; m < decays.size(); ++m) {
    const double root = decays[m].root_rounding, decay = decays[m].decay_per_s;
    const double rounding = decay > 0.0 ? root * root / (3.0 * decay) : 0.0;
    multipoles.error_db[m] = std::min(0.0, 10.0 * std::log10(multipoles.error_db[m] + rounding));
    multipoles.decay_per_s.push_back(half * decay);
  }
}

}  // namespace

std::vector<double> find_played_freq_hz(const bank::Bank& bank) {
  if (!bank.corrected.is_empty()) return bank.corrected.freq_hz;
  std::vector<double> freq_hz;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) freq_hz.push_back(bank.freq_hz(m));
  return freq_hz;
}

double calc_mass_bound(const Radiator& radiator, const AirOptions& options) {
  std::vector<double> squares(radiator.count_motions());  // surface integrals, of linear functions
  for (std::size_t t = 0; t < radiator.triangles.size(); ++t) {
    const auto& [a, b, c] = radiator.triangles[t];
    const double area = 0.5 * norm(cross(radiator.nodes_m[b] - radiator.nodes_m[a], radiator.nodes_m[c] - radiator.nodes_m[a]));
    const float* v = &radiator.velocity[t * 3 * squares.size()];
    for (std::size_t m = 0; m < squares.size(); ++m) {
      const double x = v[m], y = v[squares.size() + m], z = v[2 * squares.size() + m];
      squares[m] += area / 6.0 * (x * x + y * y + z * z + x * y + y * z + z * x);
    }
  }
  squares.resize(radiator.count_modes());
  const double most = squares.empty() ? 0.0 : *std::max_element(squares.begin(), squares.end());
  return find_density(options) * radiator.sphere.radius_m * most;
}

Radiator make_radiator(const bank::Bank& bank, std::span<const double> freq_hz, const AirOptions& options) {
  Radiator radiator;
  const std::vector<Triangle> outer = bank::find_outer_triangles(bank.vertices_m, bank.triangles);
  if (outer.empty()) throw InputError("the surface of the body has no outside: no closed part of it encloses a volume");
  std::vector<std::int32_t> number(bank.vertex_count(), -1);
  const std::size_t modes = bank.mode_count();
  radiator.rigid = count_rigid(bank);
  const bank::RigidMotions rigid(bank.rigid);
  for (const Triangle& triangle : outer) {
    Triangle made{};
    for (std::size_t c = 0; c < 3; ++c) {
      std::int32_t& known = number[triangle[c]];
      if (known < 0) {
        known = static_cast<std::int32_t>(radiator.nodes_m.size());
        radiator.nodes_m.push_back(bank.vertices_m[triangle[c]]);
      }
      made[c] = known;
    }
    radiator.triangles.push_back(made);
    const Vec3 twice = bank::calc_normal(bank.vertices_m, triangle);
    const double size = norm(twice);
    const Vec3 normal = size > 0.0 ? (1.0 / size) * twice : Vec3{};
    for (std::size_t c = 0; c < 3; ++c) {
      const std::int16_t* step = bank.get_steps(static_cast<std::size_t>(triangle[c]));
      for (std::size_t m = 0; m < modes; ++m, step += 3)
        radiator.velocity.push_back(
            static_cast<float>(bank.shape_scale[m] * (step[0] * normal[0] + step[1] * normal[1] + step[2] * normal[2])));
      for (std::size_t r = 0; r < radiator.rigid; ++r)
        radiator.velocity.push_back(static_cast<float>(dot(rigid.find(r, bank.vertices_m[triangle[c]]), normal)));
    }
  }
  radiator.sphere = find_enclosing_sphere(radiator.nodes_m);
  for (const double f : freq_hz) radiator.wave_number_1_m.push_back(2.0 * std::numbers::pi * f / options.sound_speed_ms);
  if (options.coarsen && radiator.nodes_m.size() > options.most_nodes) {
    auto [nodes, triangles] = options.coarsen(radiator.nodes_m, radiator.triangles, options.most_nodes);
    radiator = transfer(radiator, std::move(nodes), std::move(triangles));
  }
  check_facets(radiator, options);
  if (options.half_space) add_mirror_image(*options.half_space, radiator);
  return radiator;
}

Radiator leave_out_rigid(const Radiator& radiator) {
  Radiator made = radiator;
  made.rigid = 0;
  made.velocity.clear();
  const std::size_t motions = radiator.count_motions(), modes = radiator.count_modes();
  for (std::size_t row = 0; row < 3 * radiator.triangles.size(); ++row) {
    const auto begin = radiator.velocity.begin() + static_cast<std::ptrdiff_t>(row * motions);
    made.velocity.insert(made.velocity.end(), begin, begin + static_cast<std::ptrdiff_t>(modes));
  }
  return made;
}

double calc_roundness(const bank::Bank& bank) {
  const std::vector<Triangle> outer = bank::find_outer_triangles(bank.vertices_m, bank.triangles);
  if (outer.empty()) return 0.0;
  const RadiatingSurface surface(bank.vertices_m, outer);
  const double volume = surface.calc_volume_m3(), area = surface.calc_area_m2();
  return 36.0 * std::numbers::pi * volume * volume / (area * area * area);
}

bank::Multipoles calc_multipoles(const comm::Communicator& comm, const bank::Bank& bank, const AirOptions& options, Keeper keeper,
                                 const std::filesystem::path& answers) {
  const std::vector<double> played = find_played_freq_hz(bank);
  bool may_couple = false;  // on rank 0 at first
  const Radiator whole = comm.agree([&] { return comm.is_root() ? make_radiator(bank, played, options) : Radiator{}; });
  const Radiator modes_alone = comm.agree([&] {
    if (comm.is_root()) may_couple = calc_mass_bound(whole, options) >= kCoupleMass;
    return may_couple ? Radiator{} : leave_out_rigid(whole);
  });
  may_couple = comm.broadcast(static_cast<std::int32_t>(may_couple)) != 0;
  AirSolveOptions solve = options.solve;
  solve.shift = [&](double k, const Sounding& mode) {
    const double mass = calc_added_mass(mode, options);
    return mass >= kShiftMass ? k / std::sqrt(1.0 + mass) : k;
  };
  solve.coupling = CouplingOptions{.density_kg_m3 = find_density(options)};
  solve.coupling->is_called_for = [&](const std::vector<Sounding>& modes) {
    double most = 0.0;
    for (std::size_t m = 0; m < modes.size(); ++m) {
      const double mass = calc_added_mass(modes[m], options);
      check_mass(m, played[m], mass);
      most = std::max(most, mass);
    }
    return most >= kCoupleMass;
  };
  solve.coupling->has_rows = may_couple;
  std::optional<AnswersFile> file, coupled_file;
  const auto keep_in = [&](std::optional<AnswersFile>& kept, const std::filesystem::path& name, const Radiator& radiator) {
    if (!comm.is_root() || answers.empty()) return;
    kept.emplace(name, calc_fingerprint(radiator, solve));
    keeper.read = [&kept] { return kept->read(); };
    keeper.save = [&kept](const WaveAnswer& answer) { kept->save(answer); };
  };
  const Radiator& first = may_couple ? whole : modes_alone;
  comm.agree([&] { keep_in(file, answers, first); });
  AirSolution solution = solve_air(comm, first, solve, keeper);
  if (comm.broadcast(static_cast<std::int32_t>(solution.lacks_rows)) != 0) {  // cavity resonance: solve again with coupling rows
    solve.coupling->has_rows = true;
    // A separate file, so that a resumed run can skip the first solve.
    comm.agree([&] { keep_in(coupled_file, std::filesystem::path(answers) += ".coupled", whole); });
    solution = solve_air(comm, whole, solve, keeper);
  }
  return comm.agree([&] {
    bank::Multipoles multipoles;
    if (!comm.is_root() || solution.modes.empty()) return multipoles;
    multipoles.centre_m = solution.sphere.centre_m;
    multipoles.radius_m = solution.sphere.radius_m;
    multipoles.nearest_m = options.solve.nearest_over_radius * solution.sphere.radius_m;
    multipoles.air_density_kg_m3 = options.air_density_kg_m3;
    multipoles.sound_speed_ms = options.sound_speed_ms;
    const double residual = std::max(solve.tolerance, solution.residual);
    for (std::size_t m = 0; m < played.size(); ++m) {
      add_mode(solution.modes[m], solution.wave_number_1_m[m], residual, options, multipoles);
      check_mass(m, played[m], multipoles.added_mass.back());
    }
    const bool is_coupled = !multipoles.mixing.is_empty();
    if (is_coupled) warn_of_band(multipoles, played, options);
    if (solution.unsettled > solve.coupling->settled && options.warn)
      options.warn(
          fmt::format("the frequencies of modes coupled by the air still changed by {:.1e} (relative) in the last iteration, "
                      "which is their uncertainty",
                      solution.unsettled));
    add_decays(options, multipoles);
    for (auto* kept : {&file, &coupled_file})
      if (*kept) (*kept)->remove();
    multipoles.method = fmt::format("boundary elements (Burton-Miller, Galerkin), {} unknowns, {} wave numbers{}{}", solution.unknowns,
                                    solution.wave_numbers, options.half_space ? ", half space" : "",
                                    is_coupled ? fmt::format(", modes coupled (reciprocal to {:.1e})", solution.reciprocity) : "");
    return multipoles;
  });
}

}  // namespace carillon::air
