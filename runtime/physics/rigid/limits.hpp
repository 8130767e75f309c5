// Limits that the files of this folder share.
#pragma once

namespace carillon::rigid {

inline constexpr double kSlowest = 1e-3;   // m/s; a touch slower than this is no impact (a fall from 0.05 um)
inline constexpr double kRattling = 5e-2;  // m/s; slower touches of a pair that rattles are no impacts
inline constexpr double kTogether = 1e-4;  // s; touches nearer in time than this are one impact
inline constexpr double kTouch = 1e-7;     // m; nearer than this is in touch
inline constexpr double kDeep = 2e-6;      // m; deeper contacts are pushed out
inline constexpr double kTooDeep = 2e-5;   // m; deeper bodies are moved apart
inline constexpr double kMissing = 5e-6;   // m; excess of a missing place over all touches of a pair
inline constexpr double kPushOut = 80.0;   // 1/s; rate at which a deep touch is pushed out, or a stretched cord taken in
inline constexpr double kBalanced = 1e-4;  // of gravity: acceptable residual of a solution with zero velocity
inline constexpr int kMaxGuesses = 12;     // of a factorised problem, where it is small or rest is to be proven
inline constexpr double kSharpest = 5e-4;  // m; the least radius of a contact
inline constexpr double kSlow = 5e-3;      // m/s; slower bodies may be about to rest
inline constexpr double kLong = 0.3;       // s; slow for so long, the mean acceleration is small: less balance is enough
inline constexpr double kReach = 0.3;      // of the size of the smaller body: from so far touches are found

}  // namespace carillon::rigid
