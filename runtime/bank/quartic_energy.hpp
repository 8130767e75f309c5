// Elastic energy of large motion: hardening and coupling of modes at amplitudes above a thickness.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace carillon::bank {

/// Energy of N coupled modes beyond the linear one, all other elastic motion statically condensed: quartic in the modal coordinates
/// q [m kg^1/2], with cubic terms for a curved body. docs/equations.md E12.
///   V(q) = 1/2 sum over r < R of ( 2 l_r eta_r + eta_r^2 ),   eta_r = q^T A_r q,   l_r = linear_r . q    [J; eta and l in J^1/2]
/// Form "rows": A_r itself. Form "points": at each of P points the quadratic part of Green's strain of the gradients g = gradient q,
///   eta_r = sum over p of weight_p stress_rp . strain_p
///   sheets: g_ka, k < 3 directions of displacement, a < 2 of the midsurface; strain = (g_1 . g_1 / 2, g_2 . g_2 / 2, g_1 . g_2)
///   solids: g_ka, a < 3; strain = (g_1 . g_1 / 2, g_2 . g_2 / 2, g_3 . g_3 / 2, g_2 . g_3, g_1 . g_3, g_1 . g_2), g_a the column of a
/// Symmetric matrices: upper triangle packed by columns, (i, j), i <= j, at j (j + 1) / 2 + i, so that the first n modes are a prefix.
struct QuarticEnergy {
  std::vector<std::int32_t> modes;  // (N) mode indices in the bank, ascending
  std::vector<float> rows;          // (R, N (N + 1) / 2) J^1/2 m^-2 kg^-1; empty in form "points"
  std::vector<float> gradient;      // (P, 6 or 9, N) m^-1 kg^-1/2, component 2 k + a or 3 k + a; empty in form "rows"
  std::vector<float> stress;        // (R, P, 3 or 6) J^1/2
  std::vector<double> weight;       // (P), >= 0
  std::vector<double> linear;       // (R, N) J^1/2 m^-1 kg^-1/2, or empty: a flat body
  double rest_energy_j = 0.0;   // initial V0 of a curved body: linear energy of its lowest mode at 1/1000 of a thickness; raised by blows
  double error = 0.0;           // points: relative error of V on independent test motions
  double membrane_ratio = 0.0;  // highest coupled over lowest condensed frequency; above 1/2 the condensed inertia matters
  double thickness_m = 0.0;     // reference of amplitudes; 0: unknown

  bool is_empty() const { return modes.empty(); }
  bool is_of_points() const { return !weight.empty(); }
  std::size_t mode_count() const { return modes.size(); }
  std::size_t point_count() const { return weight.size(); }
  /// 6 for sheets, 9 for solids; 0 in form "rows".
  std::size_t gradient_count() const { return is_of_points() ? gradient.size() / (point_count() * mode_count()) : 0; }
  std::size_t strain_count() const { return gradient_count() == 6 ? 3 : gradient_count() == 9 ? 6 : 0; }
  std::size_t row_count() const;
};

inline constexpr std::size_t kMaxCoupledModes = 512, kMaxQuarticRows = 8192;
inline constexpr double kMaxMembraneRatio = 0.5;  // largest QuarticEnergy::membrane_ratio without a warning

/// Entries of a packed matrix: N (N + 1) / 2.
constexpr std::size_t count_pairs(std::size_t modes) noexcept { return modes * (modes + 1) / 2; }

/// Index of (i, j), i <= j, in a packed matrix.
constexpr std::size_t find_pair(std::size_t i, std::size_t j) noexcept { return j * (j + 1) / 2 + i; }

/// Fault of the array sizes; empty if none. An empty energy has no faults.
std::string find_size_fault(const QuarticEnergy& energy);

/// Fault of the mode indices for a bank of `modes` modes; empty if none.
std::string find_mode_fault(const QuarticEnergy& energy, std::size_t modes);

/// V(q) [J] and its gradient [N kg^-1/2] in double precision. q, gradient: (N). For checks and comparisons; the synthesiser uses
/// runtime/synth/nonlinear.
double calc_energy_j(const QuarticEnergy& energy, std::span<const double> q, std::span<double> gradient);

/// sum over r of A_r,ii^2 per coupled mode (N) [J m^-4 kg^-2]: alone, a mode of a flat body obeys q'' + lambda q + 2 (this) q^3 = 0.
std::vector<double> calc_self_coupling(const QuarticEnergy& energy);

/// Energy for the modes `chosen`, in that order, with q = 0 for the others. Empty if none is left.
QuarticEnergy select_coupled(const QuarticEnergy& energy, const std::vector<std::size_t>& chosen);

/// Energy for modes played at other frequencies: V scales with the linear energy, so that relative hardening is the same. factor: new over
/// old frequency of each mode of the bank.
void scale_frequencies(QuarticEnergy& energy, std::span<const double> factor);

/// Energy of modes that are sums of these; parts (N, N): contribution of mode j to new mode i at i N + j.
void combine_modes(QuarticEnergy& energy, std::span<const double> parts);

/// Energy after scaling density, stiffness and lengths: A scales with sqrt(stiffness) / (density size^(7/2)).
void scale_energy(QuarticEnergy& energy, double density, double stiffness, double size);

}  // namespace carillon::bank
