// K and M of a body as distributed PETSc matrices, and its rigid-body data.
#pragma once

#include "precompute/fem/materials.hpp"
#include "precompute/job/job_spec.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::fem {

/// Equations of motion M u'' + K u = 0 of the free nodes. Fixed nodes are eliminated. Row 3 r + d is direction d of the node whose
/// LocalMesh::row is r; each rank has the rows of its own free nodes.
struct System {
  petsc::MatHandle stiffness;  // K [N/m], (3n, 3n), AIJ, both triangles, symmetric positive semidefinite
  petsc::MatHandle mass;       // M [kg], (3n, 3n), AIJ, in K's pattern (diagonal when lumped): m_ij I, the zeros of I not stored
};

/// T10 formulation in nearly incompressible solids. automatic: mean dilatation, see Solid; displacement: none, which locks, for comparison.
enum class Form { automatic, displacement };

/// Mass, centre, inertia and volume of the body, fixed nodes included; mesh axes.
struct RigidBody {
  double mass_kg = 0.0;
  Vec3 centre_m{};
  std::array<double, 9> inertia_kg_m2{};  // (3, 3) row-major, about the centre of mass
  double volume_m3 = 0.0;
};

/// Assembles K and M. docs/equations.md, elasticity; OSG02 section 3.2. The matrices use arrays allocated here, so their pattern cannot be
/// changed. Nodes without tetrahedra in `local` have empty rows. Collective. Throws on every rank: InputError naming an element whose
/// Jacobian is not positive everywhere (inside out, or a misplaced mid-side node); SystemError when out of memory.
System assemble(const comm::Communicator& comm, const mesh::LocalMesh& local, const Materials& materials, job::Mass mass,
                Form form = Form::automatic);

/// Integrates the rigid-body data over the tetrahedra. Collective.
RigidBody calc_rigid_body(const comm::Communicator& comm, const mesh::LocalMesh& local, const Materials& materials);

}  // namespace carillon::fem
