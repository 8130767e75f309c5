// carillon-bank export and import: their options and what they do. Internal to the program.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace carillon::exchange {

struct ExportWishes {
  std::filesystem::path bank, out;
  std::string format;                // "glb", "faust"; empty: by the ending of `out`
  std::optional<std::size_t> modes;  // glb: all without it; faust: FaustOptions::modes
  std::vector<std::string> points;   // "X,Y,Z" in metres, or one count
  std::string radiation = "auto";
  std::string name;  // empty: the stem of the bank's file
  bool is_z_up = false;
};

/// Writes the file whole, and says what is in it on standard output (on standard error where the file goes there). Throws InputError.
void run_export(const ExportWishes& wishes);

struct ImportWishes {
  std::filesystem::path glb, out;
  std::optional<std::size_t> model;
  std::string material;
  bool is_plain = false;
};

/// The bank of a GLB file. Throws InputError.
void run_import(const ImportWishes& wishes);

}  // namespace carillon::exchange
