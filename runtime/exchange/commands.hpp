// carillon-bank export and import: options and execution. Internal to the program.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace carillon::exchange {

struct ExportWishes {
  std::filesystem::path bank, out;
  std::string format;                // "glb", "faust", "sofa", "uff"; empty: by the extension of `out`
  std::optional<std::size_t> modes;  // default: all (glb), FaustOptions::modes (faust)
  std::vector<std::string> points;   // "X,Y,Z" in metres, or a single count
  std::string radiation = "auto";
  std::string name;  // empty: stem of the bank's file
  bool is_z_up = false;
  std::string strike;  // SOFA, frequency responses: "X,Y,Z" in metres; empty: none
  // SOFA.
  bool has_bands = false;
  std::optional<double> step_deg, distance_m;
  // Frequency responses.
  std::string quantity;  // "acceleration", "velocity", "displacement"; empty: the first
  std::optional<double> spacing_hz, highest_hz;
};

/// Writes the file and prints a summary to standard output (to standard error if the file goes there). Throws InputError.
void run_export(const ExportWishes& wishes);

struct ImportWishes {
  std::filesystem::path file, out;
  std::filesystem::path mesh;  // of a Nastran punch file
  std::string unit;            // of modes of other solvers: "m-kg-s", "mm-t-s"; empty: not given
  std::optional<std::size_t> model;
  std::string material;
  bool is_plain = false;
  std::optional<bool> scales_frequencies;  // of scaled nodes
  bool is_scene = false;                   // `out` is a folder for the whole scene
};

struct MeasuredWishes {
  std::filesystem::path bank, measured;
  std::size_t modes = 0;
  double within_cents = 0.0;
  std::filesystem::path picture;  // empty: none
  bool has_json = false;
};

/// Compares a bank with the frequency responses of a universal file: table or JSON on standard output. Throws InputError.
void run_measured(const MeasuredWishes& wishes);

/// Imports a GLB file, or modes of another solver, as a bank, or a glTF scene into a folder. Throws InputError.
void run_import(const ImportWishes& wishes);

struct SilentWishes {
  std::string body;  // "box:X,Y,Z", "sphere:R", "cylinder:H,R", "capsule:H,R", an OBJ file or a bank
  std::filesystem::path out;
  std::string material;
  std::optional<double> mass_kg, density_kg_m3, young_modulus_pa, poisson_ratio;
};

/// Writes a bank without modes. Throws InputError.
void run_silent(const SilentWishes& wishes);

}  // namespace carillon::exchange
