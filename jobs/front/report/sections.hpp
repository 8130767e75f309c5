// The sections of a report, each from what is known of a bank. A section for which nothing is known says so.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "jobs/front/report/html.hpp"
#include "jobs/front/report/record.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/bank/heard.hpp"

namespace carillon::report {

/// What a report is about.
struct Subject {
  std::filesystem::path file;
  double file_bytes = 0.0;
  std::array<int, 2> version{};
  bank::Bank bank;
  std::vector<bank::HeardMode> heard;  // by number in the bank
  std::vector<bank::Check> checks;
  Record record;

  bool is_sane() const;
};

/// Why a section of the record is left out, as a sentence.
std::string explain_missing(const Subject& subject, std::string_view what);

/// The head of the page: verdict, remarks and warnings, and the figures that matter most.
Html make_head(const Subject& subject, std::string_view title);

// Of the body: the mesh as it was solved, the file of the bank, its checks, the job.
Html make_mesh_section(const Subject& subject);
Html make_bank_section(const Subject& subject);
Html make_check_section(const Subject& subject);
Html make_job_section(const Subject& subject);

// Of the modes: frequencies and decays, why none is missing, error bars, residuals.
Html make_modes_section(const Subject& subject);
Html make_proof_section(const Subject& subject);
Html make_error_section(const Subject& subject);
Html make_residual_section(const Subject& subject);

// Of the run: time and memory, by phase and rank; what was counted; programs and libraries.
Html make_time_section(const Subject& subject);
Html make_memory_section(const Subject& subject);
Html make_work_section(const Subject& subject);
Html make_program_section(const Subject& subject);

/// Seconds and memory of the whole run, where they are recorded.
std::optional<double> find_run_seconds(const Subject& subject);
std::optional<double> find_peak_bytes(const Subject& subject);

}  // namespace carillon::report
