// The elastic energy of large motion: what makes modes that move by more than a thickness stiffer, and what couples them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace carillon::bank {

/// The energy of N coupled modes beyond the linear one, with all other elastic motion statically condensed: of fourth order in the modal
/// coordinates q [m kg^1/2], of third order too where the body is curved. docs/equations.md E12.
///   V(q) = 1/2 sum over r < R of ( 2 l_r eta_r + eta_r^2 ),   eta_r = q^T A_r q,   l_r = linear_r . q    [J; eta and l in J^1/2]
/// Form "rows": A_r itself. Form "points": at each of P points the quadratic part of Green's strain of the gradients g = gradient q,
///   eta_r = sum over p of weight_p stress_rp . strain_p
///   sheets: g_ka, k < 3 directions of displacement, a < 2 of the midsurface; strain = (g_1 . g_1 / 2, g_2 . g_2 / 2, g_1 . g_2)
///   solids: g_ka, a < 3; strain = (g_1 . g_1 / 2, g_2 . g_2 / 2, g_3 . g_3 / 2, g_2 . g_3, g_1 . g_3, g_1 . g_2), g_a the column of a
/// A symmetric matrix is packed by columns of its upper triangle: (i, j), i <= j, at j (j + 1) / 2 + i, so that the first n modes are a
/// prefix.
struct QuarticEnergy {
  std::vector<std::int32_t> modes;  // (N) numbers in the bank, ascending
  std::vector<float> rows;          // (R, N (N + 1) / 2) J^1/2 m^-2 kg^-1; empty in the form "points"
  std::vector<float> gradient;      // (P, 6 or 9, N) m^-1 kg^-1/2, component 2 k + a or 3 k + a; empty in the form "rows"
  std::vector<float> stress;        // (R, P, 3 or 6) J^1/2
  std::vector<double> weight;       // (P), none negative
  std::vector<double> linear;       // (R, N) J^1/2 m^-1 kg^-1/2, or empty: a flat body
  double rest_energy_j = 0.0;   // V0 of a curved body at first: linear energy of its lowest mode at 1/1000 of a thickness; blows raise it
  double error = 0.0;           // of the points: relative error of V on motions that they were not made from
  double membrane_ratio = 0.0;  // highest coupled frequency over the lowest one of the condensed motion; above 1/2 its inertia counts
  double thickness_m = 0.0;     // by which amplitudes are judged; 0: unknown

  bool is_empty() const { return modes.empty(); }
  bool is_of_points() const { return !weight.empty(); }
  std::size_t mode_count() const { return modes.size(); }
  std::size_t point_count() const { return weight.size(); }
  /// 6 of sheets, 9 of solids; 0 in the form "rows". The sizes agree.
  std::size_t gradient_count() const { return is_of_points() ? gradient.size() / (point_count() * mode_count()) : 0; }
  std::size_t strain_count() const { return gradient_count() == 6 ? 3 : gradient_count() == 9 ? 6 : 0; }
  std::size_t row_count() const;
};

inline constexpr std::size_t kMaxCoupledModes = 512, kMaxQuarticRows = 8192;
inline constexpr double kMaxMembraneRatio = 0.5;  // of QuarticEnergy::membrane_ratio, without a warning

/// N (N + 1) / 2.
constexpr std::size_t count_pairs(std::size_t modes) noexcept { return modes * (modes + 1) / 2; }

/// Of (i, j), i <= j, in a packed matrix.
constexpr std::size_t find_pair(std::size_t i, std::size_t j) noexcept { return j * (j + 1) / 2 + i; }

/// What is wrong with the sizes of the arrays; empty when nothing is. An empty energy has no faults.
std::string find_size_fault(const QuarticEnergy& energy);

/// What is wrong with the numbers of the coupled modes in a bank of so many modes; empty when nothing is.
std::string find_mode_fault(const QuarticEnergy& energy, std::size_t modes);

/// V(q) [J] and its gradient [N kg^-1/2] by double precision. q and gradient: (N); the sizes of the energy agree. For checks and
/// comparisons; what is played: runtime/synth/nonlinear.
double calc_energy_j(const QuarticEnergy& energy, std::span<const double> q, std::span<double> gradient);

/// sum over r of A_r,ii^2 for each coupled mode (N) [J m^-4 kg^-2]: alone it moves by q'' + lambda q + 2 this q^3 = 0 on a flat body.
std::vector<double> calc_self_coupling(const QuarticEnergy& energy);

/// The energy of the bank that has the modes `chosen` of this one, in that order: of coupled modes that are not chosen q is 0. Empty where
/// none is left.
QuarticEnergy select_coupled(const QuarticEnergy& energy, const std::vector<std::size_t>& chosen);

/// The energy as modes have it that are played at other frequencies: V grows as the linear energy does, so that modes harden by as much at
/// the same motion. factor: by which the frequency of each mode of the bank is another one.
void scale_frequencies(QuarticEnergy& energy, std::span<const double> factor);

/// The energy of the body whose coupled modes are sums of these, parts (N, N): of mode j in the new mode i at i N + j.
void combine_modes(QuarticEnergy& energy, std::span<const double> parts);

/// The energy of the body with density, stiffness and lengths times these: A goes with sqrt(stiffness) / (density size^(7/2)).
void scale_energy(QuarticEnergy& energy, double density, double stiffness, double size);

}  // namespace carillon::bank
