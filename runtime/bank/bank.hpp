// Mode banks, written by precompute and played by the runtime. File layout: docs/bank-format.md.
// Reading and checking are thread-safe; write_bank is not (HDF5). Not for audio threads.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "runtime/bank/multipoles.hpp"
#include "runtime/bank/quartic_energy.hpp"
#include "runtime/bank/sensitivities.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::bank {

inline constexpr int kVersionMajor = 2;  // packed banks; others are 1.x

/// Air of OCE01 section 4, used for radiation gains and propagation.
inline constexpr double kAirDensityKgM3 = 1.21;
inline constexpr double kSoundSpeedMs = 343.0;

/// Rigid-body data of the undeformed solid, in mesh axes.
struct RigidBody {
  double mass_kg = 0.0;
  Vec3 centre_m{};                        // centre of mass
  std::array<double, 9> inertia_kg_m2{};  // (3, 3) row-major, about the centre of mass, mesh axes
  double volume_m3 = 0.0;
};

/// Isotropic elasticity and the damping law c = alpha1 lambda + alpha2 (OSG02 section 3.3, corrected). For an orthotropic body or one of
/// several materials: the isotropic equivalent, used for contact and edits; density_kg_m3 is mass over volume, and the alphas are 0 under
/// another law (Bank::damping).
struct Material {
  double young_modulus_pa = 0.0;
  double poisson_ratio = 0.0;
  double density_kg_m3 = 0.0;
  double alpha1_s = 0.0;      // stiffness-proportional
  double alpha2_per_s = 0.0;  // mass-proportional
};

/// rho c_L [Pa s/m]: impedance per area of a plane wave in the material. Poisson's ratio is kept below 1/2, where c_L is infinite.
double calc_wave_impedance(const Material& material);

/// Damping law of the bank. d in 1/s, lambda = omega^2, f = omega / 2 pi:
///   "rayleigh"           d = (alpha1 lambda + alpha2) / 2, with the alphas of Material; no numbers here
///   "internal_friction"  d = coefficient[0] omega / 2, coefficient = tan(phi) (vdDP96)
///   "caughey"            d = sum of coefficient[j] lambda^power[j] / 2 (Caughey 1960), coefficients in s^(2 power - 1)
///   "loss_table"         d = eta(f) omega / 2, loss_factor[] linear in log f, constant beyond the ends of freq_hz[]
///   "mixed"              several materials, weighted by their energies in each mode: no numbers; decays are checked for sign only
struct Damping {
  std::string law = "rayleigh";
  std::vector<double> coefficient;
  std::vector<double> power;
  std::vector<double> freq_hz;  // ascending
  std::vector<double> loss_factor;
};

/// Decay [1/s] by the bank's law, for all laws but "mixed". The numbers have passed calc_checks().
double calc_decay(const Damping& damping, const Material& material, double eigenvalue_rad2_s2);

/// Proof that no mode of the band is missing. The inertia of K - sigma M counts the eigenvalues below sigma exactly (Sylvester's law); at
/// both ends of the band and at cuts inside it the counts must agree with the modes found. C cuts, P connected components.
struct Proof {
  std::vector<double> cut_hz;                     // (C), ascending; first and last enclose the band
  std::vector<std::int64_t> below;                // (C) eigenvalues below the cut, rigid ones included
  std::vector<double> margin;                     // (C) relative distance in lambda to the nearest mode found
  std::vector<std::int64_t> rigid_per_component;  // (P) rigid motions, 6 where no node is fixed
  std::int64_t found = 0;                         // modes found between first and last cut
  double orthonormality = 0.0;                    // max |phi_i^T M phi_j - delta_ij|
  double backward_error = 0.0;                    // of the worst factorisation
  // Groups of degenerate modes (to the tolerance), whose shapes are a canonical basis of their subspace: first mode, number of modes.
  std::vector<std::int64_t> cluster_first;
  std::vector<std::int64_t> cluster_count;
  std::string method;              // description
  double complete_below_hz = 0.0;  // all modes of the mesh from the first cut to here are in the bank; 0: up to the last one
  // Frequencies on the mesh, ascending, of the modes counted between the cuts whose corrected frequencies are below the band.
  std::vector<double> below_band_hz;
};

/// Forces of the modes on the supports. S supports: patches of fixed nodes.
struct Supports {
  std::string text;                 // JSON: {"supports": [{"name": ..., "on": ..., "joint": ..., "loss": ...}, ...]}; empty: none
  std::vector<Vec3> centre_m;       // (S) of the patch
  std::vector<Vec3> normal;         // (S) unit, outward; 0 if the nodes span no area
  std::vector<double> area_m2;      // (S) 0 if the nodes span no area
  std::vector<double> thickness_m;  // (S) short side of the patch
  std::vector<double> reaction;     // (m, S, 6) N / (m kg^1/2), N m / (m kg^1/2): force on the body, couple about the centre
  std::vector<double> energy;       // (m, S) share of the mode's strain energy within one thickness of the patch

  std::size_t count() const { return area_m2.size(); }
};

/// Correction of a frequency for the discretisation error, with its reason. Values as stored.
enum class Correction : std::uint8_t {
  kOneMesh = 0,    // corrected by the estimate from one mesh
  kTwoMeshes = 1,  // corrected; two meshes agree
  kRough = 2,      // corrected with a wide bar: large estimate, or singular edges
  kStiff = 3,      // not corrected: elements much too stiff for this mode
  kLumped = 4,     // not corrected: T10 with lumped mass
  kDisputed = 5,   // not corrected: two meshes contradict each other
};
inline constexpr int kCorrectionCount = 6;
/// True if the frequency differs from the mesh's.
constexpr bool is_corrected(Correction correction) { return correction <= Correction::kRough; }
/// True if neither rough, stiff, lumped nor disputed.
constexpr bool is_reliable(Correction correction) { return correction == Correction::kOneMesh || correction == Correction::kTwoMeshes; }
/// Short name: "one mesh", "two meshes", "rough", "too stiff", "lumped T10", "disputed".
const char* describe(Correction correction);

/// Estimated modes of the body: those of the mesh less the estimated discretisation error, in the order of the mesh's frequencies
/// (corrected ones may change order).
struct Corrected {
  std::vector<double> freq_hz;         // (m) undamped; the mesh's if not corrected
  std::vector<double> decay_per_s;     // (m) by the damping law at this frequency
  std::vector<double> error_cents;     // (m) estimated distance of the k-th lowest freq_hz to the k-th of the body; infinite: unknown
  std::vector<Correction> correction;  // (m)

  bool is_empty() const { return freq_hz.empty(); }
};

/// Error of packed shapes. W witnesses.
struct Packing {
  // A-weighted exposure of the error of a hard blow, within some degrees of the normal, relative to the blow itself, by
  // calc_blow_exposure() [dB(A)]:
  double error_db = 0.0;                    // upper bound on 95 % of the outer surface, by area
  double worst_db = 0.0;                    // maximum over the vertices of the outer surface
  std::vector<std::int32_t> witness;        // (W) vertices of the outer surface whose unpacked shapes are kept for checks
  std::vector<std::int16_t> witness_shape;  // (W, m, 3) in steps of shape_scale
};

/// Problem size of the solve.
struct Counts {
  std::int64_t nodes = 0;  // volume mesh, mid-side nodes included
  std::int64_t tets = 0;
  std::int64_t components = 0;   // connected
  std::int64_t rigid_modes = 0;  // deflated: six per free component, fewer where nodes are fixed
};

/// V vertices, T triangles, m modes; rows of `shape` are (V, m, 3): all modes of a vertex are contiguous.
struct Bank {
  std::vector<Vec3> vertices_m;                        // (V), surface only, mesh axes
  std::vector<std::array<std::int32_t, 3>> triangles;  // (T), outward, counter-clockwise from outside

  std::vector<double> eigenvalue_rad2_s2;  // (m), ascending, lambda = omega^2
  std::vector<double> decay_per_s;         // (m), d = (alpha1 lambda + alpha2) / 2, or by `damping`
  std::vector<double> residual;            // (m), ||K phi - lambda M phi|| / (lambda ||M phi||)
  std::vector<double> radiation_gain;      // (m), Pa at 1 m for unit modal velocity (q' = 1 m kg^1/2 / s)
  std::vector<double> shape_scale;         // (m), kg^-1/2 per integer step
  std::vector<std::int16_t> shape;         // (V, m, 3); phi = shape * shape_scale, mass-normalised, error <= shape_scale / 2
  int shape_bytes = 2;                     // bytes per component in the file; 1 if all lie within -127 and 127 (calc_reduced)

  // Error bars [cent], one-sided widths f 2^(+-error / 1200): distance to the modes of the mesh (algebraic, a bound) and of the body
  // (discretisation, an estimate).
  std::vector<double> algebraic_error_cents;       // (m), or empty: unknown
  std::vector<double> discretisation_error_cents;  // (m), or empty: unknown; infinite: unknown for this mode
  // (m), or empty: no ambiguous facets; since 1.8. Estimated extra error if facets solved as planes are samples of a smooth surface, or
  // vice versa. Not contained in the bars above.
  std::vector<double> facet_error_cents;
  Corrected corrected;  // empty: unknown; since 1.4

  Multipoles multipoles;        // empty: air not solved; since 1.5
  QuarticEnergy quartic;        // empty: linear motion; since 1.7
  Sensitivities sensitivities;  // empty: not asked for; since 1.9

  std::optional<Packing> packing;  // banks read from packed files, since 2.0; not written by write_bank(), dropped by edits

  RigidBody rigid;
  Supports supports;  // bodies with fixed nodes, since 1.3
  Material material;
  Damping damping;
  std::string regions;         // JSON text: materials by mesh region, as in the job; empty for a single material
  std::optional<Proof> proof;  // missing in version 1.0
  Counts counts;
  std::array<double, 2> band_hz{20.0, 20000.0};
  bool complete = true;  // all modes of the band are present, by corrected frequencies; false: the lowest, or unsure
  // "T4", "T10"; "analytic": string, beam, membrane, plate or table (since 1.4); "imported": other program, accuracy unknown (since 1.8)
  std::string element;
  std::string mass;        // "consistent" or "lumped"
  std::string provenance;  // JSON text: resolved job, versions, ranks, seconds and peak memory per phase

  std::size_t mode_count() const { return eigenvalue_rad2_s2.size(); }
  std::size_t vertex_count() const { return vertices_m.size(); }
  double freq_hz(std::size_t mode) const;  // undamped, sqrt(lambda) / 2 pi
  /// Steps of all modes at a vertex, (modes, 3); may point nowhere where there are no modes.
  const std::int16_t* get_steps(std::size_t vertex) const { return shape.data() + vertex * mode_count() * 3; }
  /// phi of `mode` at `vertex` [kg^-1/2].
  Vec3 shape_at(std::size_t vertex, std::size_t mode) const {
    const std::int16_t* s = get_steps(vertex) + 3 * mode;
    const double k = shape_scale[mode];
    return {s[0] * k, s[1] * k, s[2] * k};
  }
};

/// Shapes of all modes at a point of a triangle, (m, 3) [kg^-1/2]: linear interpolation.
std::vector<double> calc_shapes(const Bank& bank, std::int32_t triangle, const Vec3& barycentric);

/// Point of a triangle [m], mesh axes. The triangle must exist.
Vec3 calc_point(const Bank& bank, std::int32_t triangle, const Vec3& barycentric);

/// Integer step of a mode with largest absolute component `largest`: largest / 32767, 0 for a mode at rest.
double calc_shape_scale(double largest);

/// `value` in steps of `scale`, rounded to nearest. |value| <= 32767 scale.
inline std::int16_t find_step(double value, double scale) {
  const double steps = scale > 0.0 ? value / scale : 0.0;
  return static_cast<std::int16_t>(static_cast<std::int32_t>(steps + std::copysign(0.5, steps)));
}

/// Fills shape_scale and shape: rounds to nearest; the scale of a mode is its largest absolute component / 32767.
void quantise_shapes(Bank& bank, std::span<const double> shapes /* (V, m, 3) */);

/// Result of one check of a bank: a figure, and the faults (empty: none).
struct Check {
  std::string property;  // "residuals"
  std::string figure;    // "worst 3.1e-09 at mode 12, limit 1e-04"
  std::vector<std::string> faults;
};

/// Checks all properties of a bank in a fixed order. If array sizes disagree only that is reported.
std::vector<Check> calc_checks(const Bank& bank);

/// Faults of a bank's content; empty if valid: array sizes agree, numbers finite, eigenvalues positive and ascending, decays >= 0 and equal
/// to the damping law, residuals below 1e-4, triangles in range, closed and outward, inertia positive definite and physically possible,
/// scales >= 0.
std::vector<std::string> find_faults(const Bank& bank);

/// One line for a bank that passed calc_checks(): number of modes in the band and its proof, if any; largest error of the frequencies.
std::string describe_completeness(const Bank& bank);
std::string describe_accuracy(const Bank& bank);
/// Extra error of ambiguous facets in a few words; empty without any.
std::string describe_facets(const Bank& bank);

/// Reads a bank. Throws InputError for all but an intact bank of a known version: missing file, not a bank, newer major version, truncated
/// or modified bytes (checksum), inconsistent arrays, invalid content. Bytes are untrusted: HDF5 does not parse them, and memory is bounded
/// by three times the file's length (packed banks: 64 MiB or 4096 times it). SystemError on read errors.
Bank read_bank(const std::filesystem::path& file);

/// Reads a bank from memory; `name` stands for the file in messages.
Bank parse_bank(std::span<const std::byte> bytes, const std::string& name = "bank in memory");

/// As read_bank, but accepts invalid content (array sizes agree): for programs that report on it with calc_checks().
Bank read_bank_unchecked(const std::filesystem::path& file);

/// Layout version (major, minor) of a bank file; reads its seal only. InputError as read_bank.
std::array<int, 2> read_version(const std::filesystem::path& file);

/// Writes a bank atomically (temporary file in the same folder, fsync, rename). Throws InputError if find_faults() is not empty or `file`
/// cannot name a bank (nothing is written), SystemError on I/O errors (nothing is left behind). Follows symbolic links.
void write_bank(const Bank& bank, const std::filesystem::path& file);

}  // namespace carillon::bank
