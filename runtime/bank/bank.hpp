// Mode banks: what precompute writes and the runtime plays. Layout on disk: docs/bank-format.md.
// Reading and checking may be done on any thread, several at once; write_bank on one thread at a time (it uses HDF5). None of it is for an
// audio thread.
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
#include "runtime/base/error.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::bank {

inline constexpr int kVersionMajor = 2;  // of packed banks; all others are 1.x

/// Air, as OCE01 section 4 has it: radiation gains are made with it and sound travels in it.
inline constexpr double kAirDensityKgM3 = 1.21;
inline constexpr double kSoundSpeedMs = 343.0;

/// Rigid-body data of the undeformed solid, in the frame of the mesh.
struct RigidBody {
  double mass_kg = 0.0;
  Vec3 centre_m{};                        // centre of mass
  std::array<double, 9> inertia_kg_m2{};  // (3, 3) row-major, about the centre of mass, axes of the mesh
  double volume_m3 = 0.0;
};

/// Isotropic elastic material and the damping law c = alpha1 lambda + alpha2 (OSG02 section 3.3, corrected). A body that is orthotropic or
/// of several materials has its isotropic equivalent here, for contact and for edits: density_kg_m3 is mass over volume, and the alphas are
/// 0 when the law is another one (Bank::damping).
struct Material {
  double young_modulus_pa = 0.0;
  double poisson_ratio = 0.0;
  double density_kg_m3 = 0.0;
  double alpha1_s = 0.0;      // stiffness-proportional
  double alpha2_per_s = 0.0;  // mass-proportional
};

/// rho c_L [Pa s/m]: of a plane wave into the material, per area. Poisson's ratio is kept from 1/2, where that wave is infinitely fast.
double calc_wave_impedance(const Material& material);

/// How the decays came about, by name and numbers. d in 1/s, lambda = omega^2, f = omega / 2 pi:
///   "rayleigh"           d = (alpha1 lambda + alpha2) / 2, with the alphas of Material; no numbers here
///   "internal_friction"  d = coefficient[0] omega / 2, where the coefficient is tan(phi) (vdDP96)
///   "caughey"            d = sum of coefficient[j] lambda^power[j] / 2 (Caughey 1960), coefficients in s^(2 power - 1)
///   "loss_table"         d = eta(f) omega / 2, loss_factor[] interpolated linearly in log f and constant beyond the ends of freq_hz[]
///   "mixed"              several materials, weighed by their energies in each mode: no numbers here, decays are only checked for their
///   sign
struct Damping {
  std::string law = "rayleigh";
  std::vector<double> coefficient;
  std::vector<double> power;
  std::vector<double> freq_hz;  // ascending
  std::vector<double> loss_factor;
};

/// The decay [1/s] of a mode by the bank's law, for any law but "mixed". The numbers have passed calc_checks().
double calc_decay(const Damping& damping, const Material& material, double eigenvalue_rad2_s2);

/// Why no mode of the band is missing. The inertia of K - sigma M counts the eigenvalues below sigma exactly (Sylvester's law); at both
/// ends of the band and at cuts inside it the counts have to agree with the modes that were found. C cuts, P connected components.
struct Proof {
  std::vector<double> cut_hz;                     // (C), ascending; the first and the last enclose the band
  std::vector<std::int64_t> below;                // (C) eigenvalues below the cut, rigid ones included
  std::vector<double> margin;                     // (C) relative distance in lambda to the nearest mode found
  std::vector<std::int64_t> rigid_per_component;  // (P) rigid motions, 6 where no node is fixed
  std::int64_t found = 0;                         // modes found between the first and the last cut
  double orthonormality = 0.0;                    // max |phi_i^T M phi_j - delta_ij|
  double backward_error = 0.0;                    // of the worst factorisation behind a count
  std::vector<std::int64_t> cluster_first;  // groups of degenerate modes, to the tolerance: their shapes are one subspace, in which the
  std::vector<std::int64_t> cluster_count;  // basis is canonical; first mode and how many
  std::string method;                       // in words
  double complete_below_hz = 0.0;           // every mode of the mesh from the first cut to here is in the bank; 0: up to its last one
};

/// What the modes do to that which fixes the body. S supports: patches of fixed nodes that belong together.
struct Supports {
  std::string text;             // JSON: {"supports": [{"name": ..., "on": ..., "joint": ..., "loss": ...}, ...]}; empty: nothing is fixed
  std::vector<Vec3> centre_m;   // (S) of the patch
  std::vector<Vec3> normal;     // (S) unit, out of the body; 0 where the nodes span no area
  std::vector<double> area_m2;  // (S) 0 where the nodes span none
  std::vector<double> thickness_m;  // (S) the short side of the patch
  std::vector<double> reaction;     // (m, S, 6) N / (m kg^1/2), N m / (m kg^1/2): force on the body, couple about the centre
  std::vector<double> energy;       // (m, S) share of the mode's strain energy within one thickness of the patch

  std::size_t count() const { return area_m2.size(); }
};

/// Why a frequency was corrected for the error of the mesh, or why not. The numbers are those of the file.
enum class Correction : std::uint8_t {
  kOneMesh = 0,    // corrected by the estimate of one mesh
  kTwoMeshes = 1,  // corrected; two meshes agree on it
  kRough = 2,      // corrected, but the estimate is a large share of the frequency or comes from singular edges: a wide bar
  kStiff = 3,      // not: the elements are much too stiff for this mode
  kLumped = 4,     // not: T10 with a lumped mass
  kDisputed = 5,   // not: two meshes contradict each other
};
inline constexpr int kCorrectionCount = 6;
/// Whether the frequency is another than the mesh's.
constexpr bool is_corrected(Correction correction) { return correction <= Correction::kRough; }
/// In a word or two: "one mesh", "two meshes", "rough", "too stiff", "lumped T10", "disputed".
const char* describe(Correction correction);

/// What the modes of the body are believed to be, after the error of the mesh was estimated and taken off. One entry a mode, in the order
/// of the mesh's frequencies; corrected ones change places.
struct Corrected {
  std::vector<double> freq_hz;         // (m) undamped; the mesh's own where it was not corrected
  std::vector<double> decay_per_s;     // (m) by the damping law at this frequency
  std::vector<double> error_cents;     // (m) the k-th lowest freq_hz is so near to the k-th of the body, an estimate; infinite: unknown
  std::vector<Correction> correction;  // (m)

  bool is_empty() const { return freq_hz.empty(); }
};

/// What is known of shapes that were packed: they are not quite what the solve found. W witnesses.
struct Packing {
  // A-weighted exposure of the error of a hard blow, within some degrees of the normal, relative to that of the blow itself, by
  // calc_blow_exposure() [dB(A)]:
  double error_db = 0.0;                    // on 95 % of the outer surface, by area, it is no greater
  double worst_db = 0.0;                    // at the vertex of the outer surface where it is greatest
  std::vector<std::int32_t> witness;        // (W) vertices of the outer surface whose shapes before packing are kept, for checks
  std::vector<std::int16_t> witness_shape;  // (W, m, 3) in steps of shape_scale
};

/// Sizes of the solve behind the bank.
struct Counts {
  std::int64_t nodes = 0;  // of the volume mesh as solved (mid-side nodes included)
  std::int64_t tets = 0;
  std::int64_t components = 0;   // connected
  std::int64_t rigid_modes = 0;  // deflated: six per free component, fewer where nodes are fixed
};

/// A mode bank. V vertices, T triangles, m modes; rows of `shape` are (V, m, 3) so that all modes of a vertex are adjacent.
struct Bank {
  std::vector<Vec3> vertices_m;                        // (V), surface only, frame of the mesh
  std::vector<std::array<std::int32_t, 3>> triangles;  // (T), outward, counter-clockwise from outside

  std::vector<double> eigenvalue_rad2_s2;  // (m), ascending, lambda = omega^2
  std::vector<double> decay_per_s;         // (m), d = (alpha1 lambda + alpha2) / 2, or as `damping` says
  std::vector<double> residual;            // (m), ||K phi - lambda M phi|| / (lambda ||M phi||)
  std::vector<double> radiation_gain;      // (m), Pa at 1 m for unit modal velocity (q' = 1 m kg^1/2 / s)
  std::vector<double> shape_scale;         // (m), kg^-1/2 per integer step
  std::vector<std::int16_t> shape;         // (V, m, 3); phi = shape * shape_scale, mass-normalised, error <= shape_scale / 2
  int shape_bytes = 2;                     // that a component takes in the file; 1 where all lie within -127 and 127 (calc_reduced)

  // Error bars [cent]: the true frequency is within the modes of the mesh by the first (a bound) and of the body by the second (an
  // estimate). Both are one-sided widths: f 2^(+-error / 1200).
  std::vector<double> algebraic_error_cents;       // (m), or empty: unknown
  std::vector<double> discretisation_error_cents;  // (m), or empty: unknown; infinite: of this mode unknown
  // (m), or empty: no facets in doubt; since 1.8. Estimated extra error if facets solved as planes are samples of a smooth surface, or the
  // reverse. Not contained in the bars above.
  std::vector<double> facet_error_cents;
  Corrected corrected;  // or empty: unknown; since 1.4

  Multipoles multipoles;  // or empty: the air was not solved; since 1.5
  QuarticEnergy quartic;  // or empty: motion counts as linear; since 1.7

  std::optional<Packing> packing;  // of a bank from a packed file, since 2.0; write_bank() leaves it out, edits drop it

  RigidBody rigid;
  Supports supports;  // of a body with fixed nodes, since 1.3
  Material material;
  Damping damping;
  std::string regions;         // JSON text: materials by region of the mesh, as the job gives them; empty when there is but one
  std::optional<Proof> proof;  // banks of version 1.0 have none
  Counts counts;
  std::array<double, 2> band_hz{20.0, 20000.0};
  bool complete = true;    // every mode of the band is here (false only when max_modes or calc_reduced cut the list, which keep those of
                           // the lowest corrected frequencies)
  std::string element;     // "T4", "T10"; "analytic": known modes of a string, beam, membrane, plate or table (since 1.4); "imported":
                           // modes of another program, accuracy unknown (since 1.8)
  std::string mass;        // "consistent" or "lumped"
  std::string provenance;  // JSON text: resolved job, versions, ranks, seconds and peak memory per phase

  std::size_t mode_count() const { return eigenvalue_rad2_s2.size(); }
  std::size_t vertex_count() const { return vertices_m.size(); }
  double freq_hz(std::size_t mode) const;  // undamped, sqrt(lambda) / 2 pi
  /// phi of `mode` at `vertex` [kg^-1/2].
  Vec3 shape_at(std::size_t vertex, std::size_t mode) const {
    const std::int16_t* s = &shape[(vertex * mode_count() + mode) * 3];
    const double k = shape_scale[mode];
    return {s[0] * k, s[1] * k, s[2] * k};
  }
};

/// The shapes of all modes at a point of a triangle, (m, 3) [kg^-1/2]: linear between its corners.
std::vector<double> calc_shapes(const Bank& bank, std::int32_t triangle, const Vec3& barycentric);

/// One integer step of a mode whose largest absolute component is `largest`: largest / 32767, 0 for a mode at rest.
double calc_shape_scale(double largest);

/// `value` in steps of `scale`, rounded to nearest. |value| <= 32767 scale.
inline std::int16_t find_step(double value, double scale) {
  const double steps = scale > 0.0 ? value / scale : 0.0;
  return static_cast<std::int16_t>(static_cast<std::int32_t>(steps + std::copysign(0.5, steps)));
}

/// Fills shape_scale and shape from shapes given as doubles: `row(v)` returns the (m, 3) values of vertex v.
/// Rounds to nearest; the scale of a mode is its largest absolute component / 32767.
void quantise_shapes(Bank& bank, std::span<const double> shapes /* (V, m, 3) */);

/// One property of a bank that was looked at: its figure in words, and what is wrong with it (empty when nothing is).
struct Check {
  std::string property;  // "residuals"
  std::string figure;    // "worst 3.1e-09 at mode 12, limit 1e-04"
  std::vector<std::string> faults;
};

/// Looks at every property of a bank's content, in a fixed order. When the array sizes disagree only that is reported.
std::vector<Check> calc_checks(const Bank& bank);

/// Everything that can be wrong with a bank's content, in words; empty when it is sane. Whole: array sizes agree, all numbers finite.
/// Sane: eigenvalues positive and ascending, decays >= 0 and equal to the damping law, residuals below 1e-4, triangles inside range and
/// closed and outward, inertia positive definite and physically possible, scales >= 0.
std::vector<std::string> find_faults(const Bank& bank);

/// One line each, of a bank that has passed calc_checks(): how many modes its band holds and why that is sure, or that nothing makes it so;
/// how wrong its frequencies can be, the worst of all modes.
std::string describe_completeness(const Bank& bank);
std::string describe_accuracy(const Bank& bank);
/// The extra error of ambiguous facets, in a few words; empty without any.
std::string describe_facets(const Bank& bank);

/// Reads a bank. Throws InputError for anything that is not a whole bank of a version this reader knows: missing file, not a bank,
/// newer major version, truncated or changed bytes (checksum), arrays that disagree, content that is not sane. Bytes are untrusted: no
/// byte is interpreted by HDF5, and no more memory is taken than three times the file's length (of a packed bank, than 64 MiB or 4096 times
/// it). SystemError when the disk fails to read.
Bank read_bank(const std::filesystem::path& file);

/// The same from bytes in memory; `name` stands for the file in messages.
Bank parse_bank(std::span<const std::byte> bytes, const std::string& name = "bank in memory");

/// The same as read_bank, but an insane content is no error: for programs that report on it with calc_checks(). Array sizes agree.
Bank read_bank_unchecked(const std::filesystem::path& file);

/// Major and minor version of the layout of a bank file; looks at its seal only. InputError as read_bank.
std::array<int, 2> read_version(const std::filesystem::path& file);

/// The shapes of all modes at one vertex, (m) [kg^-1/2], without reading the rest of the file: version and length are checked, the
/// checksum is not (that would read it all). Throws InputError as read_bank does, and when there is no such vertex.
std::vector<Vec3> read_shape_row(const std::filesystem::path& file, std::size_t vertex);

/// Writes a bank: temporary file next to `file`, fsync, rename, fsync of the folder. Throws InputError when find_faults() is not empty or
/// `file` cannot name a bank (nothing is written), SystemError when the disk refuses (nothing is left behind). A link is followed.
void write_bank(const Bank& bank, const std::filesystem::path& file);

}  // namespace carillon::bank
