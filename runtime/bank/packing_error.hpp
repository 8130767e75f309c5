// Error of packed shapes in the sound of blows. Internal to carillon::bank.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

inline constexpr double kExactDb = -200.0;   // no error
inline constexpr double kRoundingDb = 0.05;  // between results of two machines

/// Ratio of an error to a signal [dB].
double calc_db(double error, double signal);

/// Normals of the vertices, and their shares of the area of the outer surface, the place of blows; 0 elsewhere.
struct StruckSkin {
  std::vector<double> area_m2;
  std::vector<Vec3> normal;
};

/// Audible energy of a blow at a vertex with these shapes (m, 3) [steps of shape_scale], and of the difference to other shapes.
double calc_heard(const std::vector<double>& weight, const Vec3& normal, const std::int16_t* shape);
double calc_heard(const std::vector<double>& weight, const Vec3& normal, const std::int16_t* shape, const std::int16_t* other);

/// Blows at all vertices, and their audible energy.
struct Blows {
  StruckSkin skin;
  std::vector<double> weight;    // (m)
  std::vector<double> exposure;  // (V) at least `quietest`
  double quietest = 0.0;         // kQuietest times the loudest place of the outer surface

  explicit Blows(const Bank& bank);
};

}  // namespace carillon::bank
