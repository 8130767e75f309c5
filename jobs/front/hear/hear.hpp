// carillon hear: mesh, modes, a scene with a few strikes, WAV, spectrogram and a table of the first modes of an object.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "runtime/bank/heard.hpp"
#include "runtime/base/error.hpp"

namespace carillon::hear {

struct Order {
  std::filesystem::path object;              // a surface (OBJ, STL, PLY, OFF, glTF) or a mesh (.msh, .vtu, .mesh); empty: a shape
  std::string shape;                         // of carillon-mesh --shape
  std::map<std::string, double> dimensions;  // of the shape, by its names ("outer-radius")
  std::optional<double> wall_m;              // a shell of this thickness
  std::optional<double> scale;               // metres per unit of the file
  bool facets = false;                       // the facets are planes of the body, not samples of a smooth surface
  std::vector<double> heights_m;             // of the object (up: y); one sound each
  std::vector<std::string> materials;        // names; empty: kDefaultMaterial
  std::string mallet = "hard-wood";
  std::optional<double> accuracy_cents;  // refine until every error bar is within it; none: preview only
  std::filesystem::path out;             // folder; empty: NAME-sound here
  bool is_quiet = false;                 // no progress on standard error
};

inline constexpr const char* kDefaultMaterial = "steel";

/// One mode at the first strike.
struct StruckMode {
  bank::HeardMode heard;
  double error_cents = 0.0;  // infinite: unknown
  double facet_cents = 0.0;  // bank::Bank::facet_error_cents
  double level_dba = 0.0;    // initial level, relative to the loudest mode
};

/// The result for one material and height.
struct Sound {
  std::string name;  // "cup-steel-0.1m"
  std::string material;
  double height_m = 0.0;  // 0: as in the file
  std::filesystem::path bank, scene, wav, spectrogram;
  std::vector<StruckMode> modes;  // the lowest modes
  std::size_t mode_count = 0;
  double highest_hz = 0.0;     // of its modes
  bool is_complete = true;     // all modes from 20 to 20000 Hz; false: only the lowest ones
  double worst_cents = 0.0;    // the widest error bar
  double facet_cents = 0.0;    // largest uncertainty from facets; 0: none
  bool is_edited = false;      // scaled from another solve
  double poisson_cents = 0.0;  // error of scaling with unchanged Poisson's ratio, included in the error bars
};

struct Heard {
  std::filesystem::path folder, page;  // page: report.html of the first sound
  std::filesystem::path explorer;      // folder of the page with all sounds; empty: not installed
  std::vector<std::string> assumed;    // assumptions, one line each
  std::vector<std::string> warnings;   // differences between mesh and object, one line each
  std::array<double, 3> extent_m{};    // of the first sound's body
  std::vector<Sound> sounds;
  double seconds = 0.0;  // wall clock
};

/// An error bar for display: two digits, and whole cents from 10 on.
std::string format_cents(double cents);

/// Meshes, solves and renders: first a preview; with `accuracy_cents` again on finer meshes. Files are written atomically to options.out,
/// which is locked meanwhile. InputError, SolveError, SystemError, also of the started programs, with their messages. SIGINT, SIGTERM and
/// SIGHUP end the programs, then this process.
Heard hear(const Order& options);

}  // namespace carillon::hear
