// Modes that another solver computed on its mesh of tetrahedra, and the bank of them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/base/includes.hpp"
#include "runtime/material/material.hpp"

namespace carillon::exchange {

/// Units of the model: metres, kilograms, seconds; or millimetres, tonnes, seconds.
enum class ModelUnits { kMetre, kMillimetre };

struct ResultsReading {
  const material::Material* material = nullptr;  // mass, contact stiffness and damping; required
  ModelUnits units = ModelUnits::kMetre;
  bool are_units_given = false;  // else bodies above 10 units are refused
};

/// A real mode in the units of the model.
struct SolvedMode {
  double eigenvalue_rad2_s2 = 0.0;
  std::optional<double> mass = 1.0;   // generalised: shapes are divided by its root; nullopt: by the density of the material
  std::optional<double> decay_per_s;  // of its amplitude; nullopt: that of the material
  std::vector<Vec3> shape;            // (nodes)
};

struct SolvedModel {
  std::string program;                         // that computed the modes, with its version
  std::vector<Vec3> nodes;                     // (N, 3)
  std::vector<std::vector<std::size_t>> tets;  // indices of 4 nodes, or of 10: corners, then the middles of 01, 12, 20, 03, 13, 23
  std::vector<SolvedMode> modes;
  std::optional<ModelUnits> units;  // that the file names
};

/// Bank of the surface of the tetrahedra and of all modes but the rigid ones, those below 1e-8 of the highest eigenvalue. Frequencies and
/// shapes are the model's: their accuracy is unknown. Throws InputError "name: ...".
bank::Bank make_bank(const SolvedModel& model, const std::string& name, const ResultsReading& reading, std::vector<std::string>* notes);

/// CalculiX (.frd of *FREQUENCY with *NODE FILE, U). Throws InputError "name:line: ...".
SolvedModel parse_frd(std::string_view bytes, const std::string& name);

/// Nastran: real eigenvectors of a punch file (.pch, SORT1) on the grids and tetrahedra of a bulk data file (.bdf). The file names no
/// generalised masses. Throws InputError "name:line: ..." of the file at fault.
SolvedModel parse_pch(std::string_view bytes, const std::string& name, const base::JoinedText& mesh, const std::string& mesh_name);

/// (modes) Integral of density times squared shape over the tetrahedra, in the units of the model.
std::vector<double> calc_generalised_masses(const SolvedModel& model, double density);

/// Universal files (.unv, .uff): nodes (dataset 2411), elements (2412) and real normal modes (55). Throws InputError "name:line: ...".
SolvedModel parse_unv(std::string_view bytes, const std::string& name);

}  // namespace carillon::exchange
