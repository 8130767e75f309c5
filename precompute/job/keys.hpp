// Keys of a job and their words, for the reader, the resolved job and the reference (docs/howto/make-a-bank.md).
#pragma once

#include <string>
#include <vector>

#include "precompute/job/job_spec.hpp"
#include "runtime/base/keys.hpp"

namespace carillon::job {

// In the order of the enumerations.
inline const std::vector<std::string> kElementNames{"T4", "T10"};
inline const std::vector<std::string> kMassNames{"consistent", "lumped"};
inline const std::vector<std::string> kShapesNames{"packed", "exact"};
inline const std::vector<std::string> kMethodNames{"automatic", "block-lanczos", "krylov-schur", "dense"};
inline const std::vector<std::string> kFactorisationNames{"automatic", "ldlt", "mumps"};
inline const std::vector<std::string> kAirNames{"none", "auto", "bem"};

inline constexpr const char* kFileMaterial = "file";  // "material"

inline constexpr double kMaxHz = 1e12;
inline constexpr double kMinBodyM = 1e-6, kMaxBodyM = 1e4;
inline constexpr base::Limits kBodyLength{kMinBodyM, kMaxBodyM};

extern const base::Keys<JobSpec> kJobKeys, kSolverKeys;
extern const base::Keys<Body> kSurfaceKeys, kMeshSizeKeys;
extern const base::Keys<Fixed> kFixedKeys;
extern const base::Keys<Air> kAirKeys;
extern const base::Keys<Nonlinear> kNonlinearKeys;
extern const base::Keys<Resources> kResourceKeys;

}  // namespace carillon::job
