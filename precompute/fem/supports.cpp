// Method: fixed nodes of one entry that are connected by tetrahedra form one support: every rank joins those of its own elements, rank 0
//   merges across ranks. The reaction is summed over the elements that touch fixed nodes, a few modes at a time; only the shapes at the
//   nodes of these elements are fetched.
// Source: the reaction of a mode, e.g. Meirovitch, Principles and Techniques of Vibrations (1997), 7.16 (constraint forces).
#include "precompute/fem/supports.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <unordered_map>

#include "precompute/comm/exchange.hpp"
#include "precompute/fem/element.hpp"
#include "precompute/mesh/parts.hpp"
#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::fem {
namespace {

using mesh::LocalMesh;

constexpr PetscInt kBlock = 16;             // modes per block
constexpr std::size_t kMaxSupports = 1000;  // beyond it, one support per entry
constexpr double kOpenShare = 0.05;         // of the area: a patch whose face normals sum to less is closed and has no normal

/// A fixed node of a rank's elements, sent to rank 0. `root`: a node of the mesh connected to it.
struct NodeRecord {
  std::int32_t node, entry, root, pad;
  Vec3 x;
};

/// A face with all corners fixed by one entry, counter-clockwise from outside the element.
struct FaceRecord {
  std::array<std::int32_t, 3> node;
  std::int32_t entry;
};

/// Fixed nodes of this rank's elements, joined by the elements.
std::vector<NodeRecord> list_nodes(const LocalMesh& local) {
  mesh::Parts joined(local.nodes_m.size());
  std::vector<char> is_used(local.nodes_m.size(), 0);
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    std::array<std::pair<std::int32_t, std::int32_t>, kMaxNodes> fixed;  // entry, node
    std::size_t count = 0;
    for (const std::int32_t node : local.get_tet(e)) {
      if (local.fixed_by[node] >= 0) fixed[count++] = {local.fixed_by[node], node};
    }
    std::sort(fixed.begin(), fixed.begin() + count);
    for (std::size_t i = 0; i < count; ++i) {
      is_used[fixed[i].second] = 1;
      if (i > 0 && fixed[i].first == fixed[i - 1].first) joined.join(fixed[i].second, fixed[i - 1].second);
    }
  }
  std::vector<NodeRecord> list;
  for (std::size_t i = 0; i < is_used.size(); ++i) {
    if (is_used[i] == 0) continue;
    const std::int32_t root = joined.find(static_cast<std::int32_t>(i));
    list.push_back({local.node_in_mesh[i], local.fixed_by[i], local.node_in_mesh[root], 0, local.nodes_m[i]});
  }
  return list;
}

std::vector<FaceRecord> list_faces(const LocalMesh& local) {
  std::vector<FaceRecord> list;
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    const auto nodes = local.get_tet(e);
    for (const auto& face : mesh::kFaces) {
      const std::int32_t entry = local.fixed_by[nodes[face[0]]];
      if (entry < 0 || local.fixed_by[nodes[face[1]]] != entry || local.fixed_by[nodes[face[2]]] != entry) continue;
      FaceRecord record{{}, entry};
      for (std::size_t k = 0; k < 3; ++k) record.node[k] = local.node_in_mesh[nodes[face[k]]];
      list.push_back(record);
    }
  }
  return list;
}

/// Result of rank 0: support and position of each node.
struct Member {
  std::int32_t node, support;
  Vec3 x;
};

struct Layout {
  std::vector<Support> list;
  std::vector<Member> members;  // by node
};

/// Unique nodes with their supports; rank 0.
Layout find_members(std::vector<NodeRecord> nodes) {
  std::sort(nodes.begin(), nodes.end(), [](const NodeRecord& a, const NodeRecord& b) { return a.node < b.node; });
  Layout layout;
  for (const NodeRecord& record : nodes) {
    if (layout.members.empty() || layout.members.back().node != record.node)
      layout.members.push_back({record.node, record.entry, record.x});
  }
  const auto find = [&](std::int32_t node) {
    return static_cast<std::int32_t>(
        std::lower_bound(layout.members.begin(), layout.members.end(), node, [](const Member& a, std::int32_t b) { return a.node < b; }) -
        layout.members.begin());
  };
  mesh::Parts joined(layout.members.size());
  for (const NodeRecord& record : nodes) joined.join(find(record.node), find(record.root));
  // The lowest node of a set is its root, so the order by entry and lowest node does not depend on the partition.
  std::vector<std::pair<std::int32_t, std::int32_t>> roots;  // entry, place
  for (std::size_t i = 0; i < layout.members.size(); ++i) {
    if (joined.find(static_cast<std::int32_t>(i)) == static_cast<std::int32_t>(i))
      roots.emplace_back(layout.members[i].support, static_cast<std::int32_t>(i));
  }
  std::sort(roots.begin(), roots.end());
  const bool is_many = roots.size() > kMaxSupports;
  std::map<std::int32_t, std::int32_t> of_root;
  for (const auto& [entry, root] : roots) {
    if (!is_many || layout.list.empty() || layout.list.back().entry != entry) layout.list.emplace_back().entry = entry;
    of_root[root] = static_cast<std::int32_t>(layout.list.size()) - 1;
  }
  for (std::size_t i = 0; i < layout.members.size(); ++i) {
    const std::int32_t root = joined.find(static_cast<std::int32_t>(i));
    if (root != static_cast<std::int32_t>(i)) layout.members[i].support = of_root[root];
  }
  for (const auto& [root, support] : of_root) layout.members[root].support = support;
  return layout;
}

/// Middle eigenvalue of a symmetric matrix: for a flat patch the smaller one in its plane.
double calc_middle_eigenvalue(const std::array<double, 9>& c) {
  const double mean = (c[0] + c[4] + c[8]) / 3.0;
  std::array<double, 9> b = c;
  for (int k = 0; k < 3; ++k) b[4 * k] -= mean;
  double square = 0.0;
  for (const double x : b) square += x * x;
  const double p = std::sqrt(square / 6.0);
  if (!(p > 0.0)) return mean;
  for (double& x : b) x /= p;
  const double half = 0.5 * (b[0] * (b[4] * b[8] - b[5] * b[7]) - b[1] * (b[3] * b[8] - b[5] * b[6]) + b[2] * (b[3] * b[7] - b[4] * b[6]));
  const double angle = std::acos(std::clamp(half, -1.0, 1.0)) / 3.0;
  const double max = 2.0 * std::cos(angle), min = 2.0 * std::cos(angle + 2.0 * std::acos(-1.0) / 3.0);
  return mean + p * (0.0 - max - min);
}

/// Keeps faces of the body's surface: drops those shared by two elements.
std::vector<FaceRecord> find_outer(std::vector<FaceRecord> faces) {
  const auto key = [](const FaceRecord& face) {
    std::array<std::int32_t, 3> sorted = face.node;
    std::sort(sorted.begin(), sorted.end());
    return sorted;
  };
  std::sort(faces.begin(), faces.end(), [&](const FaceRecord& a, const FaceRecord& b) { return key(a) < key(b); });
  std::vector<FaceRecord> outer;
  for (std::size_t i = 0; i < faces.size();) {
    std::size_t end = i + 1;
    while (end < faces.size() && key(faces[end]) == key(faces[i])) ++end;
    if (end == i + 1) outer.push_back(faces[i]);
    i = end;
  }
  return outer;
}

/// Centre, area, normal and thickness of every support; rank 0.
void measure(const std::vector<FaceRecord>& faces, Layout& layout) {
  const std::size_t count = layout.list.size();
  std::vector<Vec3> origin(count, Vec3{}), first(count, Vec3{}), normal(count, Vec3{});
  std::vector<double> nodes(count, 0.0);
  std::vector<std::array<double, 9>> second(count);
  for (const Member& member : layout.members) {
    nodes[member.support] += 1.0;
    for (int k = 0; k < 3; ++k) origin[member.support][k] += member.x[k];
  }
  for (std::size_t s = 0; s < count; ++s)
    for (double& x : origin[s]) x /= nodes[s];
  const auto find = [&](std::int32_t node) -> const Member& {
    return *std::lower_bound(layout.members.begin(), layout.members.end(), node,
                             [](const Member& a, std::int32_t b) { return a.node < b; });
  };
  for (const FaceRecord& face : faces) {
    const Member* corner[3] = {&find(face.node[0]), &find(face.node[1]), &find(face.node[2])};
    const std::size_t s = corner[0]->support;
    Vec3 x[3], sum{};
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) {
        x[i][k] = corner[i]->x[k] - origin[s][k];
        sum[k] += x[i][k];
      }
    Vec3 a, b;
    for (int k = 0; k < 3; ++k) {
      a[k] = x[1][k] - x[0][k];
      b[k] = x[2][k] - x[0][k];
    }
    const Vec3 n = cross(a, b);
    const double area = 0.5 * calc_length(n);
    layout.list[s].area_m2 += area;
    for (int k = 0; k < 3; ++k) {
      normal[s][k] += 0.5 * n[k];
      first[s][k] += area * sum[k] / 3.0;
    }
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        second[s][3 * r + c] += area / 12.0 * (x[0][r] * x[0][c] + x[1][r] * x[1][c] + x[2][r] * x[2][c] + sum[r] * sum[c]);
  }
  for (std::size_t s = 0; s < count; ++s) {
    Support& support = layout.list[s];
    support.centre_m = origin[s];
    const double area = support.area_m2;
    if (!(area > 0.0)) continue;
    for (int k = 0; k < 3; ++k) support.centre_m[k] += first[s][k] / area;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) second[s][3 * r + c] = second[s][3 * r + c] / area - first[s][r] * first[s][c] / (area * area);
    support.thickness_m = std::sqrt(std::max(0.0, 12.0 * calc_middle_eigenvalue(second[s])));
    const double size = calc_length(normal[s]);
    if (size > kOpenShare * area)
      for (int k = 0; k < 3; ++k) support.normal[k] = normal[s][k] / size;
  }
}

/// The supports, the same on every rank. Collective.
Layout find_layout(const comm::Communicator& comm, const LocalMesh& local) {
  const auto nodes = comm::gather(comm, [&] { return list_nodes(local); });
  auto faces = comm::gather(comm, [&] { return list_faces(local); });
  Layout layout;
  comm.agree([&] {
    if (!comm.is_root()) return;
    layout = find_members(nodes);
    measure(find_outer(std::move(faces)), layout);
  });
  layout.list = comm.broadcast(std::move(layout.list));
  layout.members = comm.broadcast(std::move(layout.members));
  return layout;
}

/// Fixed nodes of a support in grid cells as wide as its thickness.
class Nearby {
 public:
  Nearby(const Layout& layout, std::int32_t support) : width_m_(layout.list[support].thickness_m) {
    low_.fill(1e300);
    high_.fill(-1e300);
    for (const Member& member : layout.members) {
      if (member.support != support) continue;
      for (int k = 0; k < 3; ++k) {
        low_[k] = std::min(low_[k], member.x[k]);
        high_[k] = std::max(high_[k], member.x[k]);
      }
      if (width_m_ > 0.0) cells_[find_cell(member.x, {0, 0, 0})].push_back(member.x);
    }
  }

  /// Distance to the nearest node if at most one thickness; else infinite.
  double find_distance(const Vec3& x) const {
    double nearest = 1e300;
    if (!(width_m_ > 0.0)) return nearest;
    for (int k = 0; k < 3; ++k)
      if (x[k] < low_[k] - width_m_ || x[k] > high_[k] + width_m_) return nearest;
    for (int i = -1; i <= 1; ++i)
      for (int j = -1; j <= 1; ++j)
        for (int k = -1; k <= 1; ++k) {
          const auto cell = cells_.find(find_cell(x, {i, j, k}));
          if (cell == cells_.end()) continue;
          for (const Vec3& y : cell->second) nearest = std::min(nearest, calc_length(x - y));
        }
    return nearest <= width_m_ ? nearest : 1e300;
  }

 private:
  std::uint64_t find_cell(const Vec3& x, const std::array<int, 3>& step) const {
    std::uint64_t key = 0;
    for (int k = 0; k < 3; ++k) {
      const auto at = static_cast<std::int64_t>(std::floor((x[k] - low_[k]) / width_m_)) + step[k] + 2;
      key = key * 2097152 + static_cast<std::uint64_t>(std::clamp<std::int64_t>(at, 0, 2097151));
    }
    return key;
  }

  double width_m_;
  Vec3 low_{}, high_{};
  std::unordered_map<std::uint64_t, std::vector<Vec3>> cells_;
};

/// An element that touches fixed nodes or is near them.
struct Near {
  std::int32_t tet;
  std::int32_t support;  // support that gets its energy
};

/// Nearest support of every element that touches fixed nodes or whose centre is within one thickness of some.
std::vector<Near> find_near(const LocalMesh& local, const Layout& layout, const std::vector<std::int32_t>& support_of) {
  std::vector<Nearby> nearby;
  for (std::size_t s = 0; s < layout.list.size(); ++s) nearby.emplace_back(layout, static_cast<std::int32_t>(s));
  std::vector<Near> list;
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    const auto nodes = local.get_tet(e);
    std::int32_t best = -1;
    for (const std::int32_t node : nodes) {
      if (support_of[node] >= 0 && (best < 0 || support_of[node] < best)) best = support_of[node];
    }
    if (best < 0) {
      Vec3 middle{};
      for (std::size_t i = 0; i < 4; ++i)
        for (int k = 0; k < 3; ++k) middle[k] += local.nodes_m[nodes[i]][k] / 4.0;
      double min = 1e300;
      for (std::size_t s = 0; s < nearby.size(); ++s) {
        const double distance = nearby[s].find_distance(middle);
        if (distance >= min) continue;
        min = distance;
        best = static_cast<std::int32_t>(s);
      }
    }
    if (best >= 0) list.push_back({e, best});
  }
  return list;
}

/// Rows of the shapes at selected nodes, a few modes at a time.
class Fetch {
 public:
  /// Collective.
  Fetch(const comm::Communicator& comm, const LocalMesh& local, const std::vector<std::int32_t>& nodes, Mat shapes) : shapes_(shapes) {
    petsc::check(MatGetLocalSize(shapes, &rows_, nullptr));
    petsc::check(MatDenseGetLDA(shapes, &stride_));
    std::vector<PetscInt> wanted;
    for (const std::int32_t node : nodes)
      for (PetscInt d = 0; d < 3; ++d) wanted.push_back(3 * static_cast<PetscInt>(local.row[node]) + d);
    petsc::check(MatCreateVecs(shapes, nullptr, whole_.out()));
    petsc::check(VecCreateSeq(PETSC_COMM_SELF, static_cast<PetscInt>(wanted.size()), part_.out()));
    petsc::IsHandle from;
    petsc::check(ISCreateGeneral(comm, static_cast<PetscInt>(wanted.size()), wanted.data(), PETSC_COPY_VALUES, from.out()));
    petsc::check(VecScatterCreate(whole_, from, part_, nullptr, scatter_.out()));
    count_ = wanted.size();
  }

  /// values: (modes, 3 nodes). Collective.
  void get(PetscInt first, PetscInt count, std::vector<double>& values) {
    values.resize(static_cast<std::size_t>(count) * count_);
    const double* columns = nullptr;
    petsc::check(MatDenseGetArrayRead(shapes_, &columns));
    for (PetscInt j = 0; j < count; ++j) {
      petsc::check(VecPlaceArray(whole_, columns + std::ptrdiff_t{first + j} * stride_));
      petsc::check(VecScatterBegin(scatter_, whole_, part_, INSERT_VALUES, SCATTER_FORWARD));
      petsc::check(VecScatterEnd(scatter_, whole_, part_, INSERT_VALUES, SCATTER_FORWARD));
      petsc::check(VecResetArray(whole_));
      const double* got = nullptr;
      petsc::check(VecGetArrayRead(part_, &got));
      std::copy_n(got, count_, values.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(j) * count_));
      petsc::check(VecRestoreArrayRead(part_, &got));
    }
    petsc::check(MatDenseRestoreArrayRead(shapes_, &columns));
  }

 private:
  Mat shapes_;
  PetscInt rows_ = 0, stride_ = 0;
  std::size_t count_ = 0;
  petsc::VecHandle whole_, part_;
  petsc::ScatterHandle scatter_;
};

/// Input of the sums over the elements.
struct Sums {
  const LocalMesh& local;
  const Layout& layout;
  const std::vector<std::int32_t>& support_of;  // (n), -1: free
  const std::vector<std::int32_t>& place;       // (n) index of a free node among those fetched
  std::size_t width = 0;                        // 3 times the nodes fetched
};

/// Adds one element's contribution for one mode.
void add_element(const Sums& sums, const Near& near, const ElementMatrices& element, const double* phi, double lambda, double* reaction,
                 double* energy) {
  const auto nodes = sums.local.get_tet(near.tet);
  const int n = element.nodes, width = 3 * n;
  std::array<double, 3 * kMaxNodes> u{}, f;
  for (int i = 0; i < n; ++i) {
    if (sums.place[nodes[i]] < 0) continue;
    for (int d = 0; d < 3; ++d) u[3 * i + d] = phi[3 * sums.place[nodes[i]] + d];
  }
  double twice = 0.0;
  for (int r = 0; r < width; ++r) {
    double sum = 0.0;
    for (int c = 0; c < width; ++c) sum += element.stiffness[r * width + c] * u[c];
    f[r] = sum;
    twice += u[r] * sum;
  }
  energy[near.support] += twice;
  for (int i = 0; i < n; ++i) {
    const std::int32_t s = sums.support_of[nodes[i]];
    if (s < 0) continue;
    Vec3 force;
    for (int d = 0; d < 3; ++d) {
      force[d] = f[3 * i + d];
      for (int j = 0; j < n; ++j) force[d] -= lambda * element.mass[i * n + j] * u[3 * j + d];
    }
    Vec3 arm;
    for (int d = 0; d < 3; ++d) arm[d] = sums.local.nodes_m[nodes[i]][d] - sums.layout.list[s].centre_m[d];
    const Vec3 couple = cross(arm, force);
    for (int d = 0; d < 3; ++d) {
      reaction[6 * s + d] += force[d];
      reaction[6 * s + 3 + d] += couple[d];
    }
  }
}

}  // namespace

Supports calc_supports(const comm::Communicator& comm, const LocalMesh& local, const Materials& materials, job::Mass mass,
                       std::span<const double> lambda, Mat shapes) {
  Supports supports;
  if (comm.all(std::none_of(local.fixed_by.begin(), local.fixed_by.end(), [](std::int32_t entry) { return entry >= 0; }))) return supports;
  const Layout layout = find_layout(comm, local);
  const std::size_t count = layout.list.size(), modes = lambda.size();
  std::vector<std::int32_t> support_of, place, fetched;
  std::vector<Near> near;
  comm.agree([&] {
    support_of.assign(local.nodes_m.size(), -1);
    for (std::size_t i = 0; i < support_of.size(); ++i) {
      if (local.fixed_by[i] < 0) continue;
      const auto at = std::lower_bound(layout.members.begin(), layout.members.end(), local.node_in_mesh[i],
                                       [](const Member& a, std::int32_t b) { return a.node < b; });
      if (at != layout.members.end() && at->node == local.node_in_mesh[i]) support_of[i] = at->support;
    }
    near = find_near(local, layout, support_of);
    place.assign(local.nodes_m.size(), -1);
    for (const Near& one : near)
      for (const std::int32_t node : local.get_tet(one.tet)) {
        if (local.row[node] < 0 || place[node] >= 0) continue;
        place[node] = static_cast<std::int32_t>(fetched.size());
        fetched.push_back(node);
      }
    supports.reaction.assign(modes * count * 6, 0.0);
    supports.energy.assign(modes * count, 0.0);
  });
  supports.list = layout.list;
  if (modes == 0) return supports;
  Fetch fetch(comm, local, fetched, shapes);
  const Sums sums{local, layout, support_of, place, 3 * fetched.size()};
  std::vector<Solid> solids(materials.list.begin(), materials.list.end());
  ElementMatrices element;
  std::array<Vec3, kMaxNodes> x;
  std::vector<double> phi;
  for (std::size_t first = 0; first < modes; first += kBlock) {
    const std::size_t block = std::min<std::size_t>(kBlock, modes - first);
    fetch.get(static_cast<PetscInt>(first), static_cast<PetscInt>(block), phi);
    for (const Near& one : near) {
      const auto nodes = local.get_tet(one.tet);
      for (std::size_t i = 0; i < nodes.size(); ++i) x[i] = local.nodes_m[nodes[i]];
      // The Jacobians were checked by the assembly.
      if (!calc_element({x.data(), nodes.size()}, solids[materials.find(one.tet)], mass, element)) continue;
      for (std::size_t j = 0; j < block; ++j) {
        add_element(sums, one, element, phi.data() + j * sums.width, lambda[first + j], &supports.reaction[(first + j) * count * 6],
                    &supports.energy[(first + j) * count]);
      }
    }
  }
  comm.sum(supports.reaction);
  comm.sum(supports.energy);
  for (std::size_t m = 0; m < modes; ++m)
    for (std::size_t s = 0; s < count; ++s)
      supports.energy[m * count + s] = std::clamp(supports.energy[m * count + s] / lambda[m], 0.0, 1.0);
  return supports;
}

}  // namespace carillon::fem
