// Limits shared by the files of this folder.
#pragma once

namespace carillon::rigid {

inline constexpr double kMinImpactSpeedMS = 1e-3;   // m/s; slower touches are no impacts (a fall from 0.05 um)
inline constexpr double kRattleSpeedMS = 8e-2;      // m/s; slower touches of a rattling pair are no impacts
inline constexpr double kRattleS = 60e-3;           // s; a pair with more impacts than Pair::slow_hits in this time has none for as long
inline constexpr double kSimultaneousS = 1e-4;      // s; touches nearer in time are one impact
inline constexpr double kLongestPulseS = 0.2;       // s; of a blow on a body that bends far
inline constexpr double kTouchGapM = 1e-7;          // m; smaller gaps count as contact
inline constexpr double kGapDriftM = 5e-7;          // m; change of the gap of a rolling contact per step, between bodies,
inline constexpr double kGroundDriftM = 8e-6;       // m; and on the ground: less than a floor is rough
inline constexpr double kDeepM = 2e-6;              // m; deeper contacts are pushed out
inline constexpr double kMaxDepthM = 2e-5;          // m; deeper bodies are moved apart
inline constexpr double kMissingDepthM = 5e-6;      // m; excess of a missing touch over all touches of a pair
inline constexpr double kPushOutRatePerS = 80.0;    // 1/s; removal rate of penetration or of the stretch of a cord
inline constexpr double kRestResidualRatio = 1e-4;  // relative to gravity: permitted residual of a solution with zero velocity
inline constexpr int kMaxGuesses = 12;              // of a factorised problem, for small ones and proofs of rest
inline constexpr double kMinContactRadiusM = 5e-4;  // m; minimum contact radius: that of sharp mesh edges
inline constexpr double kSlowSpeedMS = 5e-3;        // m/s; slower bodies may be coming to rest
inline constexpr double kLongSlowS = 0.3;  // s; after this time at low speed the mean acceleration is small: a larger residual is permitted
inline constexpr double kSearchRangeRatio = 0.3;  // relative to the size of the smaller body: search distance of touches

}  // namespace carillon::rigid
