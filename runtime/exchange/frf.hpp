// Frequency response functions of a bank, and those of universal files (dataset 58).
#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/exchange/struck_point.hpp"

namespace carillon::exchange {

/// Motion per force: receptance, mobility, accelerance. The value is the number of derivatives by time.
enum class Motion { kDisplacement = 0, kVelocity = 1, kAcceleration = 2 };

/// A frequency response function, time factor e^{+i omega t}.
struct Frf {
  std::int64_t response_node = 0, reference_node = 0;
  int response_direction = 0, reference_direction = 0;  // 1, 2, 3: x, y, z; negative: against the axis; others: unknown
  Motion motion = Motion::kAcceleration;
  std::vector<double> freq_hz;                // (L) ascending
  std::vector<std::complex<double>> value{};  // (L) [m/N], [m/(N s)] or [m/(N s^2)]
};

struct FrfSet {
  std::map<std::int64_t, Vec3> nodes_m;  // may lack nodes of the functions
  std::vector<Frf> frfs;
};

/// Unit vector of a direction of universal files; zero for those that are not +-1, 2, 3.
Vec3 find_axis(int direction);
/// The axis nearest to a vector.
int find_direction(const Vec3& along);

/// (L) Sum over the modes of shape at the response times shape at the reference over lambda - omega^2 + 2 i d omega, times (i omega)^k, and
/// the motion of the rigid body where the bank is of a free one (six rigid modes). Frequencies and decays are those of `bank`.
/// Frequencies above 0.
std::vector<std::complex<double>> calc_frf(const bank::Bank& bank, const StruckPoint& response, const Vec3& response_axis,
                                           const StruckPoint& reference, const Vec3& reference_axis, Motion motion,
                                           const std::vector<double>& freq_hz);

/// Universal file in SI units: datasets 164, 2411 (the nodes) and of each function 58 (ASCII, double precision). The frequencies have to be
/// evenly spaced, with first one and spacing of six digits.
std::string format_frfs(const FrfSet& set, const std::string& name);

/// Reads functions (58, of type 4, ASCII or binary 58b in IEEE numbers) and nodes (15, 2411, in the unit of 164) of a universal file.
/// Values are in SI units; ordinates labelled in g become m/s^2. Throws InputError "name:line: ...".
FrfSet parse_frfs(std::string_view bytes, const std::string& name);

}  // namespace carillon::exchange
