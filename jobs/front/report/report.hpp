// The report of a finished bank: report.html in a folder, and pictures of its first modes next to it.
#pragma once

#include <filesystem>
#include <string>

#include "runtime/base/error.hpp"

namespace carillon::report {

inline constexpr const char* kPageFile = "report.html";
inline constexpr const char* kPictureFile = "report-modes.png";

struct Options {
  std::string title;                        // of the page; empty: the mesh, surface or shape of the job
  int drawn_modes = 6;                      // pictures of so many first modes, at most 12; 0: none
  std::string undrawn_reason = {};          // why there are none, for the page; empty: not drawn yet
  std::filesystem::path draw_program = {};  // empty: carillon-draw next to this program, else in PATH
  std::string explorer = {};                // folder of `carillon explore` next to the page, where there is one: the page shows it
  double draw_limit_s = 120.0;              // it is ended when it takes longer, and the report goes without pictures
};

/// Reads the bank and the record of its run and writes `folder`/report.html, whole or not at all, and `folder`/report-modes.png where
/// carillon-draw is there and works. The folder is made when there is none; an earlier report in it is replaced. `resolved_job` is the
/// job with its member "run", as carillon-precompute leaves it next to the bank; what is missing there or cannot be used is taken from the
/// bank's own copy, and what neither has is left out of the report, which says so. All text of job and bank is data: whatever it holds is
/// shown as text. The same input gives the same bytes.
/// Throws InputError for a file that is no whole bank (one whose content is not sane has a report that says so), SystemError when the disk
/// refuses.
void write_report(const std::filesystem::path& bank, const std::filesystem::path& resolved_job, const std::filesystem::path& folder,
                  const Options& options = {});

}  // namespace carillon::report
