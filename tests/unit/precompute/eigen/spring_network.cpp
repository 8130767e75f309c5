#include "tests/unit/precompute/eigen/spring_network.hpp"

#include <gtest/gtest.h>
#include <petscblaslapack.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "precompute/petsc/session.hpp"

namespace carillon::eigen::test {
namespace {

// Numbers of the free nodes, -1 where fixed.
std::vector<int> number_free_nodes(const Network& network, int& count) {
  std::vector<int> number(network.nodes.size(), 0);
  for (const int node : network.fixed) number[node] = -1;
  count = 0;
  for (int& n : number) {
    if (n == 0) n = count++;
  }
  return number;
}

// Calls add(node a, axis i, node b, axis j, value) for the entries of K.
template <typename Add>
void visit_stiffness(const Network& network, Add&& add) {
  for (const Spring& spring : network.springs) {
    const Vec3& a = network.nodes[spring.a];
    const Vec3& b = network.nodes[spring.b];
    const Vec3 d{b[0] - a[0], b[1] - a[1], b[2] - a[2]};
    const double square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        const double value = spring.is_isotropic ? (i == j ? spring.rate : 0.0) : spring.rate * d[i] * d[j] / square;
        if (value == 0) continue;
        add(spring.a, i, spring.a, j, value);
        add(spring.b, i, spring.b, j, value);
        add(spring.a, i, spring.b, j, -value);
        add(spring.b, i, spring.a, j, -value);
      }
    }
  }
}

}  // namespace

double to_hz(double lambda) { return std::sqrt(lambda) / (2 * std::numbers::pi); }

System make_system(const Network& network, MPI_Comm comm) {
  int rank = 0;
  int size = 1;
  MPI_Comm_rank(comm, &rank);
  MPI_Comm_size(comm, &size);
  int count = 0;
  const std::vector<int> number = number_free_nodes(network, count);
  const int first = count * rank / size;
  const int last = count * (rank + 1) / size;
  System system;
  std::vector<int> neighbours(network.nodes.size(), 1);
  for (const Spring& spring : network.springs) {
    ++neighbours[spring.a];
    ++neighbours[spring.b];
  }
  const int width = 3 * *std::max_element(neighbours.begin(), neighbours.end());
  check(MatCreateAIJ(comm, 3 * (last - first), 3 * (last - first), PETSC_DETERMINE, PETSC_DETERMINE, width, nullptr, width, nullptr,
                     system.stiffness.out()));
  check(MatCreateAIJ(comm, 3 * (last - first), 3 * (last - first), PETSC_DETERMINE, PETSC_DETERMINE, 1, nullptr, 0, nullptr,
                     system.mass.out()));
  visit_stiffness(network, [&](int a, std::size_t i, int b, std::size_t j, double value) {
    const int row = number[a];
    const int column = number[b];
    if (row < first || row >= last || column < 0) return;
    check(MatSetValue(system.stiffness, 3 * row + static_cast<int>(i), 3 * column + static_cast<int>(j), value, ADD_VALUES));
  });
  Problem& problem = system.problem;
  for (std::size_t node = 0; node < number.size(); ++node) {
    const int row = number[node];
    if (row < first || row >= last) continue;
    for (int d = 0; d < 3; ++d) check(MatSetValue(system.mass, 3 * row + d, 3 * row + d, network.mass_kg[node], INSERT_VALUES));
    problem.nodes.nodes_m.push_back(network.nodes[node]);
    problem.nodes.component.push_back(network.component[node]);
  }
  for (Mat mat : {system.stiffness.get(), system.mass.get()}) {
    check(MatAssemblyBegin(mat, MAT_FINAL_ASSEMBLY));
    check(MatAssemblyEnd(mat, MAT_FINAL_ASSEMBLY));
  }
  problem.stiffness = system.stiffness;
  problem.mass = system.mass;
  problem.nodes.component_count = 1 + *std::max_element(network.component.begin(), network.component.end());
  problem.nodes.fixed.resize(problem.nodes.component_count);
  for (const int node : network.fixed) {
    const std::size_t n = node;
    problem.nodes.fixed[network.component[n]].push_back(network.nodes[n]);
  }
  return system;
}

Network reorder(const Network& network, const std::vector<int>& place) {
  Network other = network;
  for (std::size_t i = 0; i < place.size(); ++i) {
    const std::size_t to = place[i];
    other.nodes[to] = network.nodes[i];
    other.mass_kg[to] = network.mass_kg[i];
    other.component[to] = network.component[i];
  }
  for (Spring& spring : other.springs) {
    spring.a = place[spring.a];
    spring.b = place[spring.b];
  }
  for (int& node : other.fixed) node = place[node];
  return other;
}

std::vector<double> calc_all_eigenvalues(const Network& network) {
  int count = 0;
  const std::vector<int> number = number_free_nodes(network, count);
  const std::size_t n = 3 * count;
  std::vector<double> dense(n * n, 0.0);
  visit_stiffness(network, [&](int a, std::size_t i, int b, std::size_t j, double value) {
    const int row = number[a];
    const int column = number[b];
    if (row < 0 || column < 0) return;
    const double mass = std::sqrt(network.mass_kg[a] * network.mass_kg[b]);
    dense[(3 * column + j) * n + 3 * row + i] += value / mass;
  });
  std::vector<double> values(n);
  auto size = static_cast<PetscBLASInt>(n);
  PetscBLASInt info = 0;
  PetscBLASInt work_size = 64 * size;
  std::vector<double> work(work_size);
  LAPACKsyev_("N", "L", &size, dense.data(), &size, values.data(), work.data(), &work_size, &info);
  return info == 0 ? values : std::vector<double>{};
}

Network make_block(int nx, int ny, int nz, Vec3 origin, double spacing) {
  Network network;
  const auto index = [&](int x, int y, int z) { return (z * ny + y) * nx + x; };
  for (int z = 0; z < nz; ++z) {
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) {
        network.nodes.push_back({origin[0] + spacing * x, origin[1] + spacing * y, origin[2] + spacing * z});
        network.mass_kg.push_back(1 + 0.1 * std::sin(1.7 * x + 2.3 * y + 0.9 * z));
        network.component.push_back(0);
        for (int dx = -1; dx <= 1; ++dx) {
          for (int dy = -1; dy <= 1; ++dy) {
            for (int dz = 0; dz <= 1; ++dz) {
              const int steps = std::abs(dx) + std::abs(dy) + dz;
              const bool is_half = dz > 0 || dy > 0 || (dy == 0 && dx > 0);  // each spring once
              if (steps < 1 || steps > 2 || !is_half) continue;
              if (x + dx < 0 || x + dx >= nx || y + dy < 0 || y + dy >= ny || z + dz >= nz) continue;
              network.springs.push_back({index(x, y, z), index(x + dx, y + dy, z + dz), 1e6 * (steps == 1 ? 1.0 : 0.5), false});
            }
          }
        }
      }
    }
  }
  return network;
}

Network join(const Network& a, const Network& b) {
  Network both = a;
  const auto shift = static_cast<int>(a.nodes.size());
  const int components = 1 + *std::max_element(a.component.begin(), a.component.end());
  both.nodes.insert(both.nodes.end(), b.nodes.begin(), b.nodes.end());
  both.mass_kg.insert(both.mass_kg.end(), b.mass_kg.begin(), b.mass_kg.end());
  for (Spring spring : b.springs) {
    spring.a += shift;
    spring.b += shift;
    both.springs.push_back(spring);
  }
  for (const int c : b.component) both.component.push_back(c + components);
  for (const int node : b.fixed) both.fixed.push_back(node + shift);
  return both;
}

std::vector<double> pick(const std::vector<double>& all, double low_hz, double high_hz) {
  std::vector<double> picked;
  for (const double lambda : all)
    if (lambda > 0 && to_hz(lambda) >= low_hz && to_hz(lambda) <= high_hz) picked.push_back(lambda);
  return picked;
}

void expect_eigenvalues(const Modes& modes, const std::vector<double>& expected) {
  ASSERT_EQ(modes.lambda.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(modes.lambda[i] / expected[i], 1.0, 1e-9) << i;
}

}  // namespace carillon::eigen::test
