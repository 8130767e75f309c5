// The calibrated table of the cost model: everything in it that was measured and not derived. tests/unit/precompute/job/cost compares it with
// recorded runs, tests/bench/predict measures new ones.
#pragma once

#include <array>
#include <cstdint>

namespace carillon::cost {

// Before the mesh is known.
inline constexpr double kFileBytesPerTet = 50;        // of a mesh file
inline constexpr std::int64_t kDefaultNodes = 10000;  // of a body whose size is not given
inline constexpr double kUnknownNodes = 60000;        // of a job of which not even the input can be read: to be safe
inline constexpr double kRefinementGrowth = 4;        // of the nodes, by a search for "accuracy_cents"
inline constexpr std::int64_t kDefaultModes = 200;    // of a band that was not counted
inline constexpr double kQuadraticNodesPerTet = 1.5;  // solids without thin walls
inline constexpr double kLinearNodesPerTet = 0.25;
inline constexpr double kSurfaceMeshSeconds = 5;  // of carillon-mesh, where its surface is not known
inline constexpr double kSurfaceMeshSecondsPerNode = 1e-4;

// Fill of the factor, of 100,000 unknowns, and its powers: 4/3 and 2 for infinite solids (George 1973). Fitted to the hollow bunny of
// 38,000 to 1,470,000 unknowns (docs/reports/scaling.md), whose walls have more elements across the finer the mesh is.
inline constexpr double kEntries = 3.0e7, kEntryPower = 1.45;
inline constexpr double kFlops = 2.5e10, kFlopPower = 2.0;
inline constexpr double kRowNeighbours = 15, kQuadraticRowNeighbours = 28;  // nodes that share an element with a node, itself included

// The eigensolver.
inline constexpr std::int64_t kDenseRows = 300;    // up to here LAPACK solves
inline constexpr std::int64_t kSliceModes = 420;   // of one slice of the spectrum
inline constexpr std::int64_t kSliceSolves = 110;  // right-hand sides of a slice, in addition to two a mode

// CPU seconds, with AVX-512, on a Xeon of the Sapphire Rapids generation while two ranks of other programs ran; an AMD EPYC that has
// kUpdateRate takes as long within a third. Factorisations are fitted to both.
inline constexpr double kStart = 0.08;
inline constexpr double kReadTet = 1.5e-6, kReadQuadraticTet = 2e-6;
inline constexpr double kPartitionTet = 1e-6;
inline constexpr double kAssembleTet = 1e-6, kAssembleQuadraticTet = 1.8e-5;
inline constexpr double kAnalyseRow = 6e-6, kAnalyseQuadraticRow = 1.1e-5;  // K and M by nodes, rigid modes, elimination order
inline constexpr double kFactorFlop = 2.0e-11, kFactorEntry = 8e-9;
inline constexpr double kSolveEntry = 1.5e-10;
inline constexpr double kBasisNumber = 1.2e-10, kSmallNumber = 4e-10;
inline constexpr double kCheckNumber = 2e-8, kCheckPair = 1e-10;
inline constexpr double kThinCorrection = 0.5;  // of the iteration: low modes of thin bodies are refined by another solve
inline constexpr double kErrorMode = 1.5e-8, kErrorQuadraticMode = 9e-8, kErrorTet = 6e-6;
// The air: measured on the bunny of 4,502 nodes and on a plate of 5,538 (docs/decisions/radiation-solve.md).
inline constexpr double kAirNode = 1e-3, kAirEntry = 5e-8, kAirProduct = 2e-9;
inline constexpr double kAirWaves = 45;   // wave numbers, where there are more modes
inline constexpr double kAirReaders = 4;  // wave numbers that a mode reads then
// Coupled modes: one solve for each pair up to so many modes, for each of so many fields a mode beyond (precompute/coupling); of a solve,
// of the strains of a field, and of a product of two fields at a point; then the search for points, by the square of the modes.
inline constexpr int kModesOfAllPairs = 40;
inline constexpr double kFieldsPerMode = 8;
inline constexpr double kCouplingSolveEntry = 1.5e-10, kCouplingPoint = 5e-8, kCouplingProduct = 2e-10, kCouplingSearch = 1e-3;
inline constexpr double kCollectNumber = 1e-8, kWriteNumber = 5e-9;
inline constexpr double kUpdateRate = 5.3e10;  // of ldlt::measure_update_rate() there

// Bytes.
inline constexpr double kProgramBytes = 57e6;                                     // of a rank without a mesh
inline constexpr double kCouplingColumns = 14;                                    // fields at all points, for each coupled mode
inline constexpr double kAirMatrixBytes = 1.1e9;                                  // of one rank, beyond which ranks share the rows
inline constexpr double kRankBytes = 35e6;                                        // what MPI and its messages take of each
inline constexpr double kMeshBytesPerTet = 200, kQuadraticMeshBytesPerTet = 600;  // mesh, partition and surface
inline constexpr double kCopiesShare = 0.42;  // of K and M as PETSc stores them: the same by blocks of nodes
inline constexpr double kFactorPeak = 1.25;   // update matrices and what solves take included, over the factor
inline constexpr double kDenseCopies = 3;     // on every rank: K, which the vectors overwrite, M, and a message of one of them
inline constexpr double kDenseWork = 3;       // on all ranks together: two matrices of LAPACK's own, the vectors as distributed
// Total over all ranks, relative to one: of everything, for halos, by log2 of the ranks, then by the step; and of a factorisation, in
// addition, whose shared fronts lie in memory together with what is on its way to them.
inline constexpr std::array<double, 3> kRankGrowth{1.1, 1.15, 1.2};
inline constexpr double kRankGrowthStep = 0.1;  // of each further doubling
inline constexpr std::array<double, 3> kFactorGrowth{1, 1.1, 1.2};

// Modes: real counts lie within these factors of Weyl's law. Curved walls are stiffer than flat ones and have fewer modes.
inline constexpr double kSolidFactor = 1.4, kThinFactor = 1.5, kCurvedFactor = 3;
inline constexpr double kWallSlenderness = 20;  // compact bodies have 5, bars 15
inline constexpr double kVerySlender = 100;     // walls a hundred times as wide as thick: PhaseSeconds of thin bodies

// What users of a prediction add, so that a job that is let in also fits.
inline constexpr double kAdmissionMargin = 1.1;                            // of memory
inline constexpr double kChargedMargin = 1.2, kChargedGbPerProcess = 0.1;  // Slurm without control groups counts libraries per process

}  // namespace carillon::cost
