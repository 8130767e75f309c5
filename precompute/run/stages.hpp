// Results of the stages of a run.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "precompute/eigen/types.hpp"
#include "precompute/fem/assemble.hpp"
#include "precompute/fem/energy.hpp"
#include "precompute/fem/error_bars/error_bars.hpp"
#include "precompute/fem/materials.hpp"
#include "precompute/fem/supports.hpp"
#include "precompute/job/setting.hpp"
#include "precompute/mesh/check.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/run/io/surface_modes.hpp"
#include "runtime/bank/quartic_energy.hpp"

namespace carillon::ldlt {
class MeshOrder;
}  // namespace carillon::ldlt

namespace carillon::run {

using io::Surface;
using job::Setting;

/// The mesh of the body, distributed over the ranks.
struct Body {
  mesh::DistributedMesh pieces;
  std::shared_ptr<const ldlt::MeshOrder> order;      // elimination order of the factorisation (CutMesh), until make_layout()
  mesh::CheckReport check;                           // rank 0
  std::vector<std::string> mesher_warnings;          // differences between mesh and surface; rank 0
  std::int64_t fixed_nodes = 0;                      // rank 0
  Surface surface;                                   // rank 0
  std::map<std::int32_t, std::string> region_names;  // rank 0
  std::string source;                                // "bunny.msh", "bar, 2000 nodes wanted"; for messages
};

struct BodyProperties {
  fem::Materials materials;
  std::vector<double> volume_m3;  // of each material
  fem::RigidBody rigid;
};

struct AssembledSystem {
  fem::System matrices;  // K and M
  BodyProperties properties;
};

struct ModeProperties {
  std::vector<double> decay_per_s;  // (m)
  fem::EnergyShares shares;         // of the materials; empty for a single one
  fem::Supports supports;           // energy and reactions at the fixed nodes
  error_bars::ErrorBars bars;
};

struct SolvedBody {
  BodyProperties properties;
  eigen::Modes modes;
  ModeProperties errors;
};

/// A solved setting of the job.
struct Solution {
  Setting setting;
  Body body;
  SolvedBody solved;
};

struct CouplingReport {
  bank::QuarticEnergy energy;  // on rank 0; mode numbers of the bank. Empty: nothing is coupled
  std::string result;          // "30 coupled modes up to 2710 Hz, ..."; empty: not requested
};

struct AirReport {
  bool is_solved = false;
  std::string why;     // reason for or against boundary elements; empty: not requested
  std::string result;  // "boundary elements ..., error -41 dB"
};

/// Printed by main at the end; filled on rank 0.
struct RunSummary {
  std::filesystem::path bank;
  std::filesystem::path resolved;
  std::string result;       // "227 modes in 20 .. 20000 Hz ...": count, completeness, accuracy
  std::string warning;      // audible error bars, and the remedy; empty: none
  bool is_stopped = false;  // by a signal, with a checkpoint; described in `result`
};

}  // namespace carillon::run
