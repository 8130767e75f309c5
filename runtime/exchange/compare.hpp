// Comparison of two banks of a body: pairs of modes, frequencies, shapes, levels.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::exchange {

struct ModePair {
  std::size_t first = 0, second = 0;  // modes of the banks, from 0
  double mac = 0.0;                   // modal assurance criterion on the surface, 0 to 1
  double cents = 0.0;                 // second over first
  double level_db = 0.0;              // second over first: gain times rms shape, the level after equal blows all over the surface
};

struct Comparison {
  std::size_t first_count = 0, second_count = 0;  // compared modes
  std::vector<double> mac;                        // (first, second)
  std::vector<ModePair> pairs;                    // ascending in `first`
  std::vector<std::size_t> first_alone, second_alone;
  double distance_m = 0.0;  // largest between the surfaces, and between corners of their boxes
};

/// Compares the `most` lowest modes. Pairs have the greatest sum of MAC (Hungarian method), and at least a MAC of 1/2. The surfaces have to
/// lie on each other to a tenth of the extent: throws InputError "`second_name`: ...".
Comparison compare(const bank::Bank& first, const bank::Bank& second, std::size_t most, const std::string& second_name);

std::string format_table(const Comparison& comparison, const bank::Bank& first, const bank::Bank& second);
std::string format_json(const Comparison& comparison, const bank::Bank& first, const bank::Bank& second);
/// The MAC as an SVG picture, pairs framed.
std::string format_picture(const Comparison& comparison, const std::string& first_name, const std::string& second_name);

}  // namespace carillon::exchange
