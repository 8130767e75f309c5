// Runs carillon-precompute under mpirun in its own folder.
#pragma once

#include <fmt/core.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "precompute/mesh/write.hpp"
#include "runtime/bank/bank.hpp"
#include "tests/support/folder.hpp"
#include "tests/support/paths.hpp"

namespace carillon::tests {

struct Outcome {
  int code = -1;
  std::string output;  // both streams
};

struct MaterialText {
  double young_modulus_pa = 200e9;
  double poisson_ratio = 0.3;
  double density_kg_m3 = 7850;
};

class JobFolder : public Folder {
 public:
  std::vector<std::string> list() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path()))
      names.push_back(std::filesystem::relative(entry.path(), path()).string());
    std::sort(names.begin(), names.end());
    return names;
  }

  /// A job on mesh.msh with bank out.bank; `more`: additional keys, each followed by a comma.
  void write_job(const MaterialText& m, const std::string& more = "", const std::string& name = "job.json") const {
    write(name, fmt::format(R"({{ {}
  "mesh": "mesh.msh", "bank": "out.bank",
  "material": {{"young_modulus_pa": {}, "poisson_ratio": {}, "density_kg_m3": {},
               "damping": {{"rayleigh": {{"alpha1_s": 1e-7, "alpha2_per_s": 1}}}}}}
}})",
                            more, m.young_modulus_pa, m.poisson_ratio, m.density_kg_m3));
  }

  Outcome run(int ranks = 1, const std::string& arguments = "job.json") const {
    for (const auto& [name, value] : std::vector<std::array<const char*, 2>>{
             {"OMPI_ALLOW_RUN_AS_ROOT", "1"}, {"OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"}, {"OPENBLAS_NUM_THREADS", "1"}})
      setenv(name, value, 1);
    const std::string command = fmt::format("cd '{}' && mpirun -np {} --oversubscribe --bind-to none '{}/carillon-precompute' {} 2>&1",
                                            path().string(), ranks, carillon::tests::get_bin_dir(), arguments);
    Outcome outcome;
    FILE* pipe = popen(command.c_str(), "r");
    std::array<char, 4096> buffer;
    while (std::size_t count = std::fread(buffer.data(), 1, buffer.size(), pipe)) outcome.output.append(buffer.data(), count);
    const int status = pclose(pipe);
    outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return outcome;
  }

  /// Runs job.json, expects success, and reads and validates the bank.
  bank::Bank solve(int ranks = 1, const std::string& arguments = "job.json", const std::string& bank_name = "out.bank") const {
    const Outcome outcome = run(ranks, arguments);
    EXPECT_EQ(outcome.code, 0) << outcome.output;
    if (outcome.code != 0) return {};
    bank::Bank result = bank::read_bank(path() / bank_name);
    const auto faults = bank::find_faults(result);
    EXPECT_TRUE(faults.empty()) << faults.front();
    return result;
  }
};

}  // namespace carillon::tests
