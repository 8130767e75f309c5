// A physics engine that moves the bodies of a scene of tests. C++17: Simbody 3.7's headers are ill-formed as C++20.
#pragma once

#include <carillon.h>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace carillon::testing {

constexpr double kRestitution = 0.5;  // of the ground, and of bodies that are not given another

/// A body of a scene at its start. SI units, world axes; rotation w x y z of the mesh axes, which are principal axes.
struct Solid {
  std::string name, kind, bank;  // kind: box, ball, or tube with its axis along x
  double half_m[3] = {};         // half extents
  double position_m[3] = {}, rotation[4] = {}, velocity_m_s[3] = {}, spin_rad_s[3] = {};
  double mass_kg = 0.0, inertia_kg_m2[3] = {};
  double modulus_pa = 1e11;  // E / (1 - nu^2)
  double restitution = kRestitution;
};

constexpr double kFriction = 0.447;  // of every contact: geometric mean of bodies (0.4) and ground (0.5)

class Engine {
 public:
  virtual ~Engine() = default;
  virtual carillon_status start(char* message, std::size_t size) = 0;
  /// One step of the host.
  virtual carillon_status step(double time_s, char* message, std::size_t size) = 0;
};

/// Options of the carillon_touches that this engine needs, and the engine; its bodies have the indices of `solids`.
void set_options(carillon_touches_options& options);
std::unique_ptr<Engine> make_engine(const std::vector<Solid>& solids, double step_s, carillon_touches* touches);

}  // namespace carillon::testing
