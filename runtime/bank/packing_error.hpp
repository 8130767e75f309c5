// The error of shapes that were packed, in what is heard of blows. Internal to carillon::bank.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

inline constexpr double kExactDb = -200.0;   // stands for no error at all
inline constexpr double kRoundingDb = 0.05;  // between figures that two machines find

/// An error over a signal [dB].
double calc_db(double error, double signal);

/// The vertices with their normals, and their shares of the area of the outer surface, on which a body is struck; 0 for those elsewhere.
struct StruckSkin {
  std::vector<double> area_m2;
  std::vector<Vec3> normal;
};

/// What is heard of a blow at a vertex with these shapes (m, 3) [steps of shape_scale], and of the difference to other ones.
double calc_heard(const std::vector<double>& weight, const Vec3& normal, const std::int16_t* shape);
double calc_heard(const std::vector<double>& weight, const Vec3& normal, const std::int16_t* shape, const std::int16_t* other);

/// Blows at all vertices, and what is heard of them.
struct Blows {
  StruckSkin skin;
  std::vector<double> weight;    // (m) of the modes
  std::vector<double> exposure;  // (V) at least `quietest`
  double quietest = 0.0;         // of the loudest place of the outer surface a part that hardly counts

  explicit Blows(const Bank& bank);
};

}  // namespace carillon::bank
