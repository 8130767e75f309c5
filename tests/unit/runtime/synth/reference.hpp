// Table of impulse responses in data/oscillator_impulse.csv.
#pragma once

#include <cmath>
#include <complex>
#include <fstream>
#include <numbers>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/paths.hpp"

namespace carillon::testing {

struct ImpulseRow {
  double lambda = 0.0, alpha1 = 0.0, alpha2 = 0.0;
  std::string regime;
  double time_s = 0.0, q = 0.0, q_dot = 0.0;
  double decay_per_s() const { return 0.5 * (alpha1 * lambda + alpha2); }
};

inline std::ostream& operator<<(std::ostream& out, const ImpulseRow& row) {
  return out << row.regime << " lambda " << row.lambda << " alpha1 " << row.alpha1 << " alpha2 " << row.alpha2 << " t " << row.time_s;
}

inline std::vector<ImpulseRow> read_impulse_reference() {
  std::ifstream in(carillon::tests::get_source_dir() + "/tests/unit/runtime/synth/data/oscillator_impulse.csv");
  std::vector<ImpulseRow> rows;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#' || line[0] == 'l') continue;
    std::istringstream cells(line);
    std::vector<std::string> cell;
    for (std::string text; std::getline(cells, text, ',');) cell.push_back(text);
    rows.push_back({std::stod(cell.at(0)), std::stod(cell.at(1)), std::stod(cell.at(2)), cell.at(3), std::stod(cell.at(4)),
                    std::stod(cell.at(5)), std::stod(cell.at(6))});
  }
  return rows;
}

/// q' of a mode t seconds after a unit impulse; also above critical damping.
inline double calc_velocity(double freq_hz, double d, double t) {
  if (t < 0.0) return 0.0;
  const std::complex<double> wd = std::sqrt(std::complex<double>(4.0 * std::numbers::pi * std::numbers::pi * freq_hz * freq_hz - d * d));
  return std::exp(-d * t) * (std::cos(wd * t) - d / wd * std::sin(wd * t)).real();
}

}  // namespace carillon::testing
