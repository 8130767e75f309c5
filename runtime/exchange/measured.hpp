// Comparison of a bank with measured frequency response functions: modes of the measurement, and their partners in the bank.
#pragma once

#include <complex>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/exchange/frf.hpp"

namespace carillon::exchange {

/// A mode fitted to a peak.
struct MeasuredMode {
  double freq_hz = 0.0, decay_per_s = 0.0;
  std::vector<std::complex<double>> residue;  // (functions) of the receptance [1/kg]: shape at the response times shape at the reference
};

/// Modes at the peaks of the sum of squared accelerances over all functions, ascending. A peak is 6 dB above the valleys on both sides. In
/// a window around it, of at least 9 lines, every receptance is fitted by one mode, common to all functions, and a constant (linear least
/// squares); peaks of which this explains less than 90 % are left out. Functions have to share their frequencies: throws InputError
/// "name: ...".
std::vector<MeasuredMode> find_modes(const FrfSet& measured, const std::string& name);

struct MeasuredPair {
  std::size_t mode = 0, peak = 0;  // of the bank and of the measurement, from 0
  double cents = 0.0;              // measurement over bank
  // Where all points and directions are known:
  std::optional<double> mac;       // of residues; with two functions or more
  std::optional<double> level_db;  // root of the sum of squared residues, measurement over bank
};

struct MeasuredComparison {
  std::size_t frf_count = 0;
  std::vector<double> freq_hz;           // (L) of the measurement, above 0
  std::vector<double> level_db;          // (L) rms accelerance over the functions, re 1 m/(N s^2)
  std::vector<double> bank_hz, bank_db;  // the same of the bank, at those and at its modes; empty: not asked for, or points unknown
  std::string unknown;                   // why they are; empty: known
  std::vector<MeasuredMode> peaks;
  std::vector<MeasuredPair> pairs;  // ascending in `mode`
  std::vector<std::size_t> modes_alone, peaks_alone;
};

/// Compares the `most` lowest modes of the bank within the measured band, as played (corrected, in air), with the peaks. Pairs have the
/// least sum of (cents / `within_cents`)^2 + 1 - MAC, and lie within that distance. `draws`: with bank_hz, bank_db. Throws InputError
/// "name: ...".
MeasuredComparison compare_measured(const bank::Bank& played, const FrfSet& measured, std::size_t most, double within_cents, bool draws,
                                    const std::string& name);

std::string format_table(const MeasuredComparison& comparison, const bank::Bank& played);
std::string format_json(const MeasuredComparison& comparison, const bank::Bank& played);
/// Both levels over frequency as an SVG picture, pairs marked.
std::string format_picture(const MeasuredComparison& comparison, const bank::Bank& played, const std::string& bank_name,
                           const std::string& measured_name);

}  // namespace carillon::exchange
