// Calibrated constants of the cost model: all measured numbers in it. tests/unit/precompute/job/cost compares them with recorded runs,
// tests/bench/predict measures new ones.
#pragma once

#include <array>
#include <cstdint>

namespace carillon::cost {

// Before the mesh is known.
inline constexpr double kFileBytesPerTet = 50;        // of a mesh file
inline constexpr std::int64_t kDefaultNodes = 10000;  // body without a given size
inline constexpr double kUnknownNodes = 60000;        // job whose input cannot be read: conservative
inline constexpr double kRefinementGrowth = 4;        // growth of the node count in a search for "accuracy_cents"
inline constexpr std::int64_t kDefaultModes = 200;    // band without a count
inline constexpr double kQuadraticNodesPerTet = 1.5;  // solids without thin walls
inline constexpr double kLinearNodesPerTet = 0.25;

// Fill of the factor at 100,000 unknowns, and exponents: 4/3 and 2 for infinite solids (George 1973). Fitted to the hollow bunny of 38,000
// to 1,470,000 unknowns (docs/reports/scaling.md), whose walls gain elements across with refinement.
inline constexpr double kEntries = 3.0e7, kEntryPower = 1.45;
inline constexpr double kFlops = 2.5e10, kFlopPower = 2.0;
inline constexpr double kRowNeighbours = 15, kQuadraticRowNeighbours = 28;  // nodes sharing an element with a node, itself included

// The eigensolver.
inline constexpr std::int64_t kDenseRows = 300;    // dense LAPACK up to this size
inline constexpr std::int64_t kSliceModes = 420;   // per slice of the spectrum
inline constexpr std::int64_t kSliceSolves = 110;  // right-hand sides per slice, plus two per mode

// CPU seconds with AVX-512 on a Sapphire Rapids Xeon with two busy ranks of other programs; an AMD EPYC, scaled by its speed in
// factorisations, agrees within a third. Factorisations are fitted to both.
inline constexpr double kStart = 0.08;
inline constexpr double kReadTet = 1.5e-6, kReadQuadraticTet = 2e-6;
inline constexpr double kPartitionTet = 1e-6;
inline constexpr double kAssembleTet = 1e-6, kAssembleQuadraticTet = 1.8e-5;
inline constexpr double kAnalyseRow = 6e-6, kAnalyseQuadraticRow = 1.1e-5;  // K and M by nodes, rigid modes, elimination order
inline constexpr double kFactorFlop = 2.0e-11, kFactorEntry = 8e-9;
inline constexpr double kSolveEntry = 1.5e-10;
inline constexpr double kBasisNumber = 1.2e-10, kSmallNumber = 4e-10;
inline constexpr double kCheckNumber = 2e-8, kCheckPair = 1e-10;
inline constexpr double kThinCorrection = 0.5;  // of the iteration: low modes of thin bodies are refined by one more solve
inline constexpr double kErrorMode = 1.5e-8, kErrorQuadraticMode = 9e-8, kErrorTet = 6e-6;
// Air: measured on the bunny of 4,502 nodes and a plate of 5,538 (docs/decisions/radiation-solve.md).
inline constexpr double kAirNode = 1e-3, kAirEntry = 5e-8, kAirProduct = 2e-9;
inline constexpr double kAirWaves = 45;   // wave numbers, if there are more modes
inline constexpr double kAirReaders = 4;  // wave numbers per mode then
// Coupled modes (precompute/coupling): one solve per pair up to this many modes, then per field, with this many fields per mode; seconds of
// a solve, of the strains of a field, of a product of two fields at a point, and of the search for points per square of the modes.
inline constexpr int kModesOfAllPairs = 40;
inline constexpr double kFieldsPerMode = 8;
inline constexpr double kCouplingSolveEntry = 1.5e-10, kCouplingPoint = 5e-8, kCouplingProduct = 2e-10, kCouplingSearch = 1e-3;
inline constexpr double kCollectNumber = 1e-8, kWriteNumber = 5e-9;

// Bytes.
inline constexpr double kProgramBytes = 57e6;                                     // rank without a mesh
inline constexpr double kCouplingColumns = 14;                                    // fields at all points, per coupled mode
inline constexpr double kAirMatrixBytes = 1.1e9;                                  // of one rank; above it ranks share the rows
inline constexpr double kRankBytes = 35e6;                                        // MPI and its messages, per rank
inline constexpr double kMeshBytesPerTet = 200, kQuadraticMeshBytesPerTet = 600;  // mesh, partition and surface
inline constexpr double kCopiesShare = 0.42;  // node-block copies of K and M relative to PETSc's storage
inline constexpr double kFactorPeak = 1.25;   // with update matrices and solve buffers, over the factor
inline constexpr double kDenseCopies = 3;     // per rank: K (overwritten by the vectors), M, and a message buffer
inline constexpr double kDenseWork = 3;       // all ranks together: two work matrices of LAPACK, the distributed vectors
// Total over all ranks relative to one, by log2 of the ranks, then by the step: halos of everything; and additionally for a factorisation,
// whose shared fronts coexist with the data sent to them.
inline constexpr std::array<double, 3> kRankGrowth{1.1, 1.15, 1.2};
inline constexpr double kRankGrowthStep = 0.1;  // per further doubling
inline constexpr std::array<double, 3> kFactorGrowth{1, 1.1, 1.2};

// Counts of real bodies lie within these factors of Weyl's law. Curved walls are stiffer than flat ones and have fewer modes.
inline constexpr double kSolidFactor = 1.4, kThinFactor = 1.5, kCurvedFactor = 3;
inline constexpr double kWallSlenderness = 20;  // compact bodies have 5, bars 15
inline constexpr double kVerySlender = 100;     // walls a hundred times as wide as thick: PhaseSeconds of thin bodies

// Margins that callers add to a prediction, so admitted jobs fit.
inline constexpr double kAdmissionMargin = 1.1;                            // of memory
inline constexpr double kChargedMargin = 1.2, kChargedGbPerProcess = 0.1;  // Slurm without control groups counts libraries per process

}  // namespace carillon::cost
