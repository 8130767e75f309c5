// The report of a finished bank: report.html, and pictures of its first modes next to it.
#pragma once

#include <filesystem>
#include <string>

#include "runtime/base/error.hpp"

namespace carillon::report {

inline constexpr const char* kPageFile = "report.html";
inline constexpr const char* kPictureFile = "report-modes.png";

struct Options {
  std::string title;                        // of the page; empty: the mesh, surface or shape of the job
  int drawn_modes = 6;                      // number of drawn modes, at most 12; 0: none
  std::string undrawn_reason = {};          // why there are no pictures, for the page; empty: not drawn yet
  std::filesystem::path draw_program = {};  // empty: carillon-draw next to this program, else in PATH
  std::string explorer = {};                // folder of carillon explore next to the page, shown in it; empty: none
  double draw_limit_s = 120.0;              // time limit of carillon-draw
};

/// Writes `folder`/report.html (atomically, self-contained, deterministic) and, if carillon-draw works, `folder`/report-modes.png, creating
/// the folder and replacing an earlier report. `resolved_job`: the job with its member "run", as carillon-precompute writes it next to the
/// bank; missing or damaged parts are taken from the copy in the bank, and missing sections are reported as such. Text of job and bank is
/// shown as text. InputError for a file that is not a complete bank (invalid content is reported in the page), SystemError when the disk
/// refuses.
void write_report(const std::filesystem::path& bank, const std::filesystem::path& resolved_job, const std::filesystem::path& folder,
                  const Options& options = {});

}  // namespace carillon::report
