// The cost model against recorded runs of carillon-precompute (recorded_runs.csv): CPU seconds by phase, peak memory and sizes, from one
// machine with AVX-512, mostly idle.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "precompute/job/cost/calibration.hpp"
#include "precompute/job/cost/memory.hpp"
#include "precompute/job/cost/seconds.hpp"
#include "tests/support/paths.hpp"

namespace carillon::cost {
namespace {

using Record = std::map<std::string, std::string>;

std::vector<Record> read_records() {
  std::ifstream file(carillon::tests::get_source_dir() + "/tests/unit/precompute/job/cost/recorded_runs.csv");
  const auto split = [](const std::string& line) {
    std::vector<std::string> words;
    std::istringstream stream(line);
    for (std::string word; std::getline(stream, word, ',');) words.push_back(word);
    return words;
  };
  std::string line;
  std::getline(file, line);
  const std::vector<std::string> names = split(line);
  std::vector<Record> records;
  while (std::getline(file, line)) {
    const std::vector<std::string> words = split(line);
    Record& record = records.emplace_back();
    for (std::size_t i = 0; i < names.size(); ++i) record[names[i]] = words.at(i);
  }
  return records;
}

double get(const Record& record, const std::string& key) { return std::stod(record.at(key)); }

ProblemSize make_size(const Record& record) {
  ProblemSize size;
  size.is_quadratic = record.at("element") == "T10";
  size.nodes = std::llround(get(record, "nodes"));
  size.tets = std::llround(get(record, "tets"));
  size.unknowns = std::llround(get(record, "unknowns"));
  size.factor_entries = std::llround(get(record, "factor_entries"));
  size.factor_flops = get(record, "factor_flops");
  size.modes = std::llround(get(record, "modes"));
  size.is_thin = record.at("thin") == "1";
  return size;
}

/// From the nodes alone, like the queue.
ProblemSize make_guess(const Record& record) {
  return estimate_meshed_size(std::llround(get(record, "nodes")), record.at("element") == "T10");
}

std::string describe(const Record& record) {
  return record.at("body") + ", " + record.at("element") + ", " + record.at("nodes") + " nodes, " + record.at("modes") + " modes, " +
         record.at("ranks") + " ranks";
}

TEST(RecordedRuns, cover_three_decades_of_size_and_both_elements) {
  const auto records = read_records();
  EXPECT_GE(records.size(), 40u);
  double min = 1e30, max = 0;
  std::map<std::string, int> elements;
  for (const Record& record : records) {
    min = std::min(min, get(record, "cpu_s"));
    max = std::max(max, get(record, "cpu_s"));
    ++elements[record.at("element")];
  }
  EXPECT_GT(max, 900 * min);
  EXPECT_GE(elements["T4"], 5);
}

TEST(RecordedRuns, cpu_seconds_with_an_analysed_factorisation) {
  double logs = 0;
  int count = 0;
  for (const Record& record : read_records()) {
    const double real = get(record, "cpu_s"), predicted = predict_seconds(make_size(record)).sum();
    EXPECT_LT(predicted, 1.5 * real + kStart) << describe(record);
    EXPECT_GT(predicted, 0.65 * real) << describe(record);
    if (real < 0.3) continue;
    logs += std::log(predicted / real);
    ++count;
  }
  EXPECT_NEAR(std::exp(logs / count), 1.0, 0.1);  // no bias
}

TEST(RecordedRuns, cpu_seconds_of_the_search_alone) {
  for (const Record& record : read_records()) {
    const double real = get(record, "modes_s"), predicted = predict_seconds(make_size(record)).sum_modes();
    EXPECT_LT(predicted, 1.35 * real + 0.08) << describe(record);
    EXPECT_GT(predicted, 0.64 * real) << describe(record);
  }
}

TEST(RecordedRuns, right_hand_sides_and_factorisations) {
  for (const Record& record : read_records()) {
    const auto solves = static_cast<double>(predict_solves(std::stoll(record.at("modes"))));
    EXPECT_LT(solves, 1.1 * get(record, "solves")) << describe(record);
    EXPECT_GT(solves, 0.5 * get(record, "solves")) << describe(record);
    EXPECT_LE(static_cast<double>(predict_factorisations(std::stoll(record.at("modes")))), get(record, "factorisations") + 1)
        << describe(record);
  }
}

TEST(RecordedRuns, memory_is_a_tight_upper_bound) {
  for (const Record& record : read_records()) {
    const int ranks = std::stoi(record.at("ranks"));
    const double real = get(record, "peak_bytes"), predicted = predict_bytes(make_size(record), ranks);
    EXPECT_GT(predicted, real) << describe(record);
    EXPECT_LT(predicted, 1.9 * real) << describe(record);
  }
}

TEST(RecordedRuns, an_estimate_from_the_nodes_alone_admits_fitting_jobs) {
  for (const Record& record : read_records()) {
    if (get(record, "modes") > kDefaultModes) continue;
    const double real = get(record, "peak_bytes");
    const double guessed = kAdmissionMargin * predict_bytes(make_guess(record), std::stoi(record.at("ranks")));
    EXPECT_GT(guessed, real) << describe(record);
    EXPECT_LT(guessed, 2.6 * real) << describe(record);
    const double seconds = predict_seconds(make_guess(record)).sum();
    EXPECT_GT(seconds, 0.6 * get(record, "cpu_s")) << describe(record);
    EXPECT_LT(seconds, 6 * get(record, "cpu_s")) << describe(record);
  }
}

}  // namespace
}  // namespace carillon::cost
