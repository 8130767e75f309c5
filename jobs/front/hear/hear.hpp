// From an object to its sound in one call: mesh, modes, a scene of a few strikes, WAV, spectrogram, and a table of the first modes.
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
  bool facets = false;                       // of the surface: true planes of the body, not samples of a smooth surface
  std::vector<double> heights_m;             // of the object (up: y); several: one after the other
  std::vector<std::string> materials;        // names; empty: kDefaultMaterial
  std::string mallet = "hard-wood";
  std::optional<double> accuracy_cents;  // refines the preview until every error bar is within it; none: preview only
  std::filesystem::path out;             // folder; empty: NAME-sound here
  bool is_quiet = false;                 // no progress on standard error
};

inline constexpr const char* kDefaultMaterial = "steel";

/// One mode as it is heard at the first strike.
struct StruckMode {
  bank::HeardMode heard;
  double error_cents = 0.0;  // infinite: unknown
  double facet_cents = 0.0;  // bank::Bank::facet_error_cents
  double level_dba = 0.0;    // of its beginning, below that of the loudest
};

/// The result for one material and height.
struct Sound {
  std::string name;  // "cup-steel-0.1m"
  std::string material;
  double height_m = 0.0;  // 0: as the file has it
  std::filesystem::path bank, scene, wav, spectrogram;
  std::vector<StruckMode> modes;  // the lowest modes
  std::size_t mode_count = 0;
  double highest_hz = 0.0;     // of its modes
  bool is_complete = true;     // every mode from 20 to 20000 Hz is there; false: only the lowest ones
  double worst_cents = 0.0;    // the widest error bar
  double facet_cents = 0.0;    // largest addition by facets in doubt; 0: no facets in doubt
  bool is_edited = false;      // of another solve, by scaling
  double poisson_cents = 0.0;  // by which that may be off, since Poisson's ratio stayed; in the error bars
};

struct Heard {
  std::filesystem::path folder, page;  // page: report.html of the first sound
  std::filesystem::path explorer;      // folder of the page on which all sounds are struck; empty: it is not installed
  std::vector<std::string> assumed;    // assumptions, one line each
  std::vector<std::string> warnings;   // differences between mesh and object, one line each
  std::array<double, 3> extent_m{};    // of the first sound's body
  std::vector<Sound> sounds;
  double seconds = 0.0;  // by the clock
};

/// An error bar for display: two digits, and whole cents from 10 on.
std::string format_cents(double cents);

/// Meshes, solves, plays: first a preview, then, where an accuracy is asked for, again on finer meshes. Files go to options.out, each whole
/// or not at all, and no other call writes there meanwhile. Throws InputError with the remedy, SolveError, SystemError; errors of the
/// programs that it starts are thrown with their message. SIGINT, SIGTERM and SIGHUP end them, and then this process.
Heard hear(const Order& options);

}  // namespace carillon::hear
