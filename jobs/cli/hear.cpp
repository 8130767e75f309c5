// carillon hear: the sound of an object.
#include "jobs/front/hear/hear.hpp"

#include <fmt/core.h>

#include <cmath>

#include "jobs/cli/commands.hpp"

namespace carillon::cli {
namespace {

base::Json describe(const hear::Sound& sound) {
  base::Json entry;
  entry.set("name", to_json(sound.name)).set("material", to_json(sound.material));
  entry.set("height_m", sound.height_m > 0.0 ? base::Json(sound.height_m) : base::Json());
  for (const auto& [key, file] :
       {std::pair{"bank", &sound.bank}, {"scene", &sound.scene}, {"wav", &sound.wav}, {"spectrogram", &sound.spectrogram}})
    entry[key] = to_json(file->string());
  entry.set("is_scaled", sound.is_edited).set("mode_count", sound.mode_count).set("highest_hz", sound.highest_hz);
  entry.set("is_complete", sound.is_complete);
  entry.set("worst_cents", std::isfinite(sound.worst_cents) ? base::Json(sound.worst_cents) : base::Json());
  entry.set("facet_cents", std::isfinite(sound.facet_cents) ? base::Json(sound.facet_cents) : base::Json());
  entry.set("modes", base::Json::array());
  for (const hear::StruckMode& mode : sound.modes) {
    base::Json& one = entry["modes"].append(base::Json::object());
    one["freq_hz"] = mode.heard.freq_hz;
    const double t60_s = mode.heard.calc_t60_s();
    one["t60_s"] = std::isfinite(t60_s) ? base::Json(t60_s) : base::Json();
    one["error_cents"] = std::isfinite(mode.error_cents) ? base::Json(mode.error_cents) : base::Json();
    one["facet_cents"] = std::isfinite(mode.facet_cents) ? base::Json(mode.facet_cents) : base::Json();
    one["level_dba"] = std::isfinite(mode.level_dba) ? base::Json(mode.level_dba) : base::Json();
  }
  return entry;
}

void print(const hear::Sound& sound) {
  std::string text = fmt::format("{}: {} modes", show(sound.name), sound.mode_count);
  if (!sound.is_complete) text += fmt::format(" up to {:.0f} Hz, incomplete above", sound.highest_hz);
  text += std::isfinite(sound.worst_cents) ? fmt::format(", error bars up to {} cents (estimates)", hear::format_cents(sound.worst_cents))
                                           : std::string(", without error bars");
  if (sound.is_edited) text += "; scaled from another solve";
  if (sound.poisson_cents > 0.0) text += fmt::format(", of which {} cents for Poisson's ratio", hear::format_cents(sound.poisson_cents));
  fmt::print("\n{}\n", text);
  const bool is_doubtful = sound.facet_cents > 0.0;
  const auto format_facets = [&](const std::string& text) { return is_doubtful ? fmt::format(" {:>8}", text) : std::string(); };
  fmt::print("{:>5} {:>10} {:>8}{} {:>9} {:>9}\n", "mode", "Hz", "+-cents", format_facets("+-facets"), "T60 [s]", "dB(A)");
  for (std::size_t m = 0; m < sound.modes.size(); ++m) {
    const hear::StruckMode& mode = sound.modes[m];
    fmt::print("{:>5} {:>10.1f} {:>8}{} {:>9.3g} {:>9}\n", m + 1, mode.heard.freq_hz,
               std::isfinite(mode.error_cents) ? hear::format_cents(mode.error_cents) : "-",
               format_facets(hear::format_cents(mode.facet_cents)), mode.heard.calc_t60_s(),
               mode.level_dba > -99.5 ? fmt::format("{:.0f}", mode.level_dba) : "<-99");
  }
  if (is_doubtful)
    fmt::print(
        "+-facets     facets may be planes of the body or samples of a smooth surface: up to {} cents more if the assumption is wrong.\n"
        "             --facets declares planes; a surface with finer facets also resolves it\n",
        hear::format_cents(sound.facet_cents));
  fmt::print("sound        {}\nspectrogram  {}\n", show(sound.wav.string(), 1000), show(sound.spectrogram.string(), 1000));
}

}  // namespace

int run_hear(Shared& shared, const HearOptions& options) {
  hear::Order wanted = options.hear;
  wanted.is_quiet = wanted.is_quiet || shared.json;
  if (wanted.shape.empty()) {
    if (const auto wall = wanted.dimensions.find("wall"); wall != wanted.dimensions.end()) {
      wanted.wall_m = wall->second;
      wanted.dimensions.erase(wall);
    }
    if (!wanted.dimensions.empty())
      throw InputError(fmt::format("--{} is a dimension of a shape; remove it, or give --shape", wanted.dimensions.begin()->first));
  } else if (wanted.heights_m.size() == 1) {
    wanted.dimensions["height"] = wanted.heights_m[0];
    wanted.heights_m.clear();
  }
  const hear::Heard heard = hear::hear(wanted);
  if (shared.json) {
    base::Json root;
    root.set("folder", to_json(heard.folder.string())).set("page", to_json(heard.page.string()));
    root.set("explorer", heard.explorer.empty() ? base::Json() : to_json(heard.explorer.string())).set("assumed", to_json(heard.assumed));
    root.set("warnings", to_json(heard.warnings));
    for (const double x : heard.extent_m) root["extent_m"].append(x);
    root["sounds"] = base::Json::array();
    for (const hear::Sound& sound : heard.sounds) root["sounds"].append(describe(sound));
    root["seconds"] = heard.seconds;
    print_json(root);
    return 0;
  }
  for (const std::string& line : heard.assumed) fmt::print("assumed      {}\n", show(line, 1000));
  for (const std::string& line : heard.warnings) fmt::print("warning      {}\n", show(line, 1000));
  fmt::print("body         {:.3g} x {:.3g} x {:.3g} m\n", heard.extent_m[0], heard.extent_m[1], heard.extent_m[2]);
  for (const hear::Sound& sound : heard.sounds) print(sound);
  fmt::print("\nreport       {}\n", show(heard.page.string(), 1000));
  if (heard.explorer.empty())
    fmt::print("to play it   the page is not installed here\n");
  else
    fmt::print("to play it   carillon explore {} --serve\n", show(heard.explorer.string(), 1000));
  fmt::print("{:.1f} s{}\n", heard.seconds, wanted.accuracy_cents ? "" : "; a preview: --accuracy 10 refines it to 10 cents");
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
  return 0;
}

}  // namespace carillon::cli
