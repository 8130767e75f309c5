// Method:     the bank is read without judging it, and so are its checks and the record of its run; each section is made from what is
//             there.
// Source:     none.
// Deviations: none.
#include "jobs/front/report/report.hpp"

#include <algorithm>

#include "jobs/front/report/draw.hpp"
#include "jobs/front/report/sections.hpp"
#include "runtime/bank/mounting/heard.hpp"
#include "runtime/base/file.hpp"

namespace carillon::report {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxDrawn = 12;  // carillon-draw takes no more

/// Modes as heard; for a damaged bank, those of the mesh.
std::vector<bank::HeardMode> find_heard(const Subject& subject) {
  try {
    if (subject.is_sane()) return mounting::calc_heard(subject.bank);
  } catch (const InputError&) {  // invalid supports
  }
  return bank::list_heard(subject.bank, {});
}

Subject read_subject(const fs::path& file, const fs::path& resolved_job) {
  Subject subject;
  subject.file = file;
  subject.bank = bank::read_bank_unchecked(file);
  subject.version = bank::read_version(file);
  std::error_code error;
  const std::uintmax_t bytes = fs::file_size(file, error);
  subject.file_bytes = error ? 0.0 : static_cast<double>(bytes);
  subject.checks = bank::calc_checks(subject.bank);
  subject.heard = find_heard(subject);
  subject.record = read_record(resolved_job, subject.bank.provenance);
  return subject;
}

/// What the job calls its body, else the name of the bank.
std::string find_title(const Subject& subject) {
  const base::Json& job = subject.record.job;
  const base::Json& body = find(job, "body");
  for (const auto& name : {find_text(job, "mesh"), find_text(body, "surface"), find_text(body, "shape")}) {
    if (name && !fs::path(*name).filename().empty()) return fs::path(*name).filename().string();
  }
  return subject.file.filename().string();
}

Html make_picture_section(const Subject& subject, const fs::path& folder, const Options& options) {
  constexpr const char* kHeading = "The first modes";
  const int modes =
      std::min({options.drawn_modes, kMaxDrawn, static_cast<int>(std::min<std::size_t>(subject.bank.mode_count(), kMaxDrawn))});
  std::error_code error;
  if (modes < 1) {
    fs::remove(folder / kPictureFile, error);
    return leave_out("pictures", kHeading,
                     subject.bank.mode_count() == 0   ? "the bank has no modes to draw."
                     : options.undrawn_reason.empty() ? "not drawn yet; carillon report draws them."
                                                      : options.undrawn_reason + ".");
  }
  const Drawing drawing = draw_modes(options.draw_program, subject.file, modes, folder / kPictureFile, options.draw_limit_s);
  if (!drawing.fault.empty()) return leave_out("pictures", kHeading, drawing.fault + ".");
  return make_section(
      "pictures", kHeading,
      html("<p><img src=\"{}\" alt=\"The first {} modes as deformed bodies, coloured by displacement\"></p>\n", kPictureFile, modes));
}

/// The body, to be played; where the page of `carillon explore` is not next to the report, how to get one.
Html make_play_section(const Options& options) {
  constexpr const char* kHeading = "Play it";
  if (options.explorer.empty()) return leave_out("play", kHeading, "carillon explore BANK --serve opens a page to strike the body on.");
  return make_section("play", kHeading,
                      html("<p><iframe src=\"{0}/index.html\" title=\"The body, to be struck and heard\" allow=\"autoplay\"></iframe></p>\n"
                           "<p>It plays where a web server has the folder: <code>carillon explore {0} --serve</code> opens it alone. "
                           "<a href=\"{0}/index.html\">The whole window</a></p>\n",
                           options.explorer));
}

Html make_page(const Subject& subject, const Html& pictures, const std::string& title) {
  Html out = html(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src &#39;none&#39;; style-src &#39;unsafe-inline&#39;; img-src * "
      "file:; frame-src &#39;self&#39; file:\">\n"
      "<meta name=\"generator\" content=\"carillon\">\n<title>{}</title>\n<style>{}</style>\n</head>\n<body>\n<main>\n",
      title, get_style());
  out += make_head(subject, title);
  out += html(
      "<nav><a href=\"#pictures\">Pictures</a><a href=\"#play\">Play</a><a href=\"#modes\">Modes</a><a href=\"#proof\">Proof</a><a "
      "href=\"#errors\">Error bars</a>"
      "<a href=\"#residuals\">Residuals</a><a href=\"#mesh\">Mesh</a><a href=\"#time\">Time</a><a href=\"#memory\">Memory</a>"
      "<a href=\"#work\">Work</a><a href=\"#size\">Size</a><a href=\"#checks\">Checks</a><a href=\"#job\">Job</a></nav>\n");
  out += pictures;
  for (Html (*make)(const Subject&) :
       {make_modes_section, make_proof_section, make_error_section, make_residual_section, make_mesh_section, make_time_section,
        make_memory_section, make_work_section, make_bank_section, make_check_section, make_job_section, make_program_section}) {
    out += make(subject);
  }
  return out += html("</main>\n</body>\n</html>\n");
}

}  // namespace

void write_report(const fs::path& bank, const fs::path& resolved_job, const fs::path& folder, const Options& options) {
  const Subject subject = read_subject(bank, resolved_job);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error || !fs::is_directory(folder))
    throw SystemError(fmt::format("{}: this folder for the report cannot be made: {}; choose another place", folder.string(),
                                  error ? error.message() : "something else has that name"));
  Html pictures = make_picture_section(subject, folder, options);
  pictures += make_play_section(options);
  const std::string title = options.title.empty() ? find_title(subject) : options.title;
  base::write_file(folder / kPageFile, make_page(subject, pictures, title).text());
}

}  // namespace carillon::report
