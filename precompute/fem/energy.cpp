// Method: K_r and M_r of the elements of one material at a time, multiplied with blocks of shapes.
// Source: Ungar and Kerwin 1962, J. Acoust. Soc. Am. 34, 954 (loss of a composite from the shares of its strain energy); OSG02 section 3.3.
#include "precompute/fem/energy.hpp"

#include <algorithm>

#include "precompute/petsc/session.hpp"

namespace carillon::fem {
namespace {

/// The mesh reduced to the tetrahedra of one material, with all nodes.
mesh::LocalMesh take_material(const mesh::LocalMesh& local, const Materials& materials, std::int32_t wanted) {
  mesh::LocalMesh part = local;
  part.tets.clear();
  part.tet_in_mesh.clear();
  part.region.clear();
  const int width = local.nodes_per_tet();
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    if (materials.find(e) != wanted) continue;
    const auto first = local.tets.begin() + static_cast<std::ptrdiff_t>(e) * width;
    part.tets.insert(part.tets.end(), first, first + width);
    part.tet_in_mesh.push_back(local.tet_in_mesh[e]);
  }
  return part;
}

/// (modes, materials), rows normalised to sum 1.
std::vector<double> normalise(const std::vector<std::vector<double>>& by_material, std::int64_t modes) {
  std::vector<double> shares;
  for (std::int64_t j = 0; j < modes; ++j) {
    double sum = 0.0;
    for (const auto& forms : by_material) sum += forms[j];
    for (const auto& forms : by_material) shares.push_back(forms[j] / sum);
  }
  return shares;
}

}  // namespace

std::vector<double> calc_forms(const comm::Communicator& comm, Mat a, Mat shapes, std::int64_t modes) {
  std::vector<double> forms(modes, 0.0);
  petsc::VecHandle x, y;
  petsc::check(MatCreateVecs(a, x.out(), y.out()));
  PetscInt rows = 0, stride = 0;
  petsc::check(MatGetLocalSize(shapes, &rows, nullptr));
  petsc::check(MatDenseGetLDA(shapes, &stride));
  const double* columns = nullptr;
  petsc::check(MatDenseGetArrayRead(shapes, &columns));
  for (std::int64_t j = 0; j < modes; ++j) {
    const double* column = columns + j * stride;
    petsc::check(VecPlaceArray(x, column));
    petsc::check(MatMult(a, x, y));
    petsc::check(VecResetArray(x));
    const double* image = nullptr;
    petsc::check(VecGetArrayRead(y, &image));
    for (PetscInt i = 0; i < rows; ++i) forms[j] += column[i] * image[i];
    petsc::check(VecRestoreArrayRead(y, &image));
  }
  petsc::check(MatDenseRestoreArrayRead(shapes, &columns));
  comm.sum(forms);
  return forms;
}

std::vector<double> calc_decay_per_s(const Materials& materials, const EnergyShares& shares, std::span<const double> lambda) {
  std::vector<double> decay_per_s;
  const std::size_t count = materials.list.size();
  for (std::size_t j = 0; j < lambda.size(); ++j) {
    if (count == 1) {
      decay_per_s.push_back(materials.list[0].calc_decay_per_s(lambda[j]));
      continue;
    }
    double c = 0.0;
    for (std::size_t r = 0; r < count; ++r)
      c += materials.list[r].calc_damping_per_s(lambda[j], shares.elastic[j * count + r], shares.kinetic[j * count + r]);
    decay_per_s.push_back(c / 2);
  }
  return decay_per_s;
}

Decay calc_decay(const comm::Communicator& comm, const mesh::LocalMesh& local, const Materials& materials, job::Mass mass,
                 std::span<const double> lambda, Mat shapes) {
  Decay decay;
  if (materials.list.size() == 1 || lambda.empty()) {
    decay.decay_per_s = calc_decay_per_s(materials, decay.shares, lambda);
    return decay;
  }
  const auto modes = static_cast<std::int64_t>(lambda.size());
  const auto count = static_cast<std::int32_t>(materials.list.size());
  std::vector<std::vector<double>> elastic, kinetic;
  for (std::int32_t r = 0; r < count; ++r) {
    const mesh::LocalMesh part = take_material(local, materials, r);
    const System system = assemble(comm, part, materials.list[r], mass);
    elastic.push_back(calc_forms(comm, system.stiffness, shapes, modes));
    kinetic.push_back(calc_forms(comm, system.mass, shapes, modes));
  }
  decay.shares = {count, normalise(elastic, modes), normalise(kinetic, modes)};
  decay.decay_per_s = calc_decay_per_s(materials, decay.shares, lambda);
  return decay;
}

}  // namespace carillon::fem
