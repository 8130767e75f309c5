// Method: the normal of the smooth surface at a vertex is the weighted mean of the normals of the surrounding faces within 50 degrees of
//   the face in question. An arc over an edge of length t with normals n_a, n_b rises (n_b - n_a) . t / 8 above the chord; the rise of the
//   mid-side node is subtracted. For T10 the rise is to fourth order: midway between the values from sines (the formula) and tangents of
//   the arc's ends; a fraction of their difference is the mean gap left by a parabolic triangle with its mid-side nodes on the surface.
//   Faces with turns of 50 to 80 degrees at all corners are planes one element wide, or samples of a round surface with five to seven
//   sides: there the alternative surface has the mean normals of the faces within 80 degrees.
// Source: weights: Max 1999, J. Graphics Tools 4(2), 1 (exact on a sphere). Arc: Vlachos et al. 2001, "Curved PN triangles".
#include "precompute/fem/error_bars/surface.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <unordered_map>

#include "precompute/comm/exchange.hpp"
#include "precompute/mesh/faces.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::error_bars {
namespace {

constexpr double kSmoothCosine = 0.642787609686539;  // 50 degrees
constexpr double kRoundCosine = 0.173648177666930;   // 80 degrees
constexpr double kSameCosine = 0.9998;               // of 1 degree
constexpr double kInwardSine = 0.766044443118978;    // of 50 degrees
constexpr double kParabola = 0.37;                   // measured on a sphere 0.36, on a cylinder 0.13

Vec3 normalise(const Vec3& a) {
  const double length = std::sqrt(dot(a, a));
  return length > 0 ? Vec3{a[0] / length, a[1] / length, a[2] / length} : Vec3{};
}

struct Face {
  std::int32_t tet = 0;
  int face = 0;  // index into mesh::kFaces
};

using FaceKey = std::array<std::int32_t, 3>;  // node numbers in the whole mesh, ascending

struct FaceHash {
  std::size_t operator()(const FaceKey& key) const {
    std::uint64_t hash = 1469598103934665603ULL;
    for (const std::int32_t id : key) hash = (hash ^ static_cast<std::uint32_t>(id)) * 1099511628211ULL;
    return hash ^ hash >> 29;
  }
};

std::int32_t get_node(const mesh::LocalMesh& local, std::int32_t tet, int i) {
  return local.tets[static_cast<std::size_t>(tet) * local.nodes_per_tet() + i];
}

FaceKey find_key(const mesh::LocalMesh& local, const Face& face) {
  FaceKey key;
  for (int i = 0; i < 3; ++i) key[i] = local.node_in_mesh[get_node(local, face.tet, mesh::kFaces[face.face][i])];
  std::sort(key.begin(), key.end());
  return key;
}

/// Faces of only one element of this rank, by element.
std::vector<Face> find_own_faces(const mesh::LocalMesh& local) {
  // Faces are bucketed by their lowest corner, so that a face is compared with the few faces of one node.
  struct Sided {
    std::int64_t rest;  // other corners, ascending, packed
    Face face;
  };
  const auto sort_corners = [&](std::int32_t e, int f) {
    FaceKey key;
    for (int i = 0; i < 3; ++i) key[i] = get_node(local, e, mesh::kFaces[f][i]);
    if (key[1] < key[0]) std::swap(key[0], key[1]);
    if (key[2] < key[1]) std::swap(key[1], key[2]);
    if (key[1] < key[0]) std::swap(key[0], key[1]);
    return key;
  };
  std::vector<std::size_t> end(local.nodes_m.size() + 1, 0);
  for (std::int32_t e = 0; e < local.tet_count(); ++e)
    for (int f = 0; f < 4; ++f) ++end[sort_corners(e, f)[0] + 1];
  std::partial_sum(end.begin(), end.end(), end.begin());
  std::vector<Sided> all(end.back());
  for (std::int32_t e = 0; e < local.tet_count(); ++e)
    for (int f = 0; f < 4; ++f) {
      const FaceKey key = sort_corners(e, f);
      all[end[key[0]]++] = {std::int64_t{key[1]} << 32 | key[2], {e, f}};
    }
  std::vector<Face> faces;
  std::size_t first = 0;
  for (std::size_t n = 0; n < local.nodes_m.size(); ++n) {
    for (std::size_t i = first; i < end[n]; ++i) {
      int times = 0;
      for (std::size_t j = first; j < end[n]; ++j) times += all[j].rest == all[i].rest ? 1 : 0;
      if (times == 1) faces.push_back(all[i].face);
    }
    first = end[n];
  }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.tet != b.tet ? a.tet < b.tet : a.face < b.face; });
  return faces;
}

/// The same over all ranks; a hash of the corners selects the rank that matches two faces. Collective.
std::vector<Face> find_faces(const comm::Communicator& comm, const mesh::LocalMesh& local) {
  auto faces = comm.agree([&] { return find_own_faces(local); });
  if (comm.size() == 1) return faces;
  const auto keys = comm.agree([&] {
    std::vector<FaceKey> list;
    for (const Face& face : faces) list.push_back(find_key(local, face));
    return list;
  });
  const auto is_outer = comm::query_owners<char>(
      comm, keys, [&](const FaceKey& key) { return static_cast<int>(FaceHash{}(key) % static_cast<std::size_t>(comm.size())); },
      [](const comm::ByRank<FaceKey>& asked) {
        std::unordered_map<FaceKey, int, FaceHash> times;
        for (const FaceKey& key : asked.items) ++times[key];
        std::vector<char> answers;
        for (const FaceKey& key : asked.items) answers.push_back(times[key] == 1);
        return answers;
      });
  std::size_t kept = 0;
  for (std::size_t f = 0; f < faces.size(); ++f)
    if (is_outer[f] != 0) faces[kept++] = faces[f];
  faces.resize(kept);
  return faces;
}

struct Corner {
  std::int32_t vertex = 0;  // in the whole mesh
  Vec3 normal{};            // unit
  double weight = 0.0;
};

/// Tangent of the surface at corner a towards corner b: of the parabola through the mid-side node if present.
Vec3 find_tangent(const mesh::LocalMesh& local, const Face& face, int a, int b) {
  const Vec3 &xa = local.nodes_m[get_node(local, face.tet, a)], &xb = local.nodes_m[get_node(local, face.tet, b)];
  if (local.order == 1) return xb - xa;
  const Vec3& xm = local.nodes_m[get_node(local, face.tet, 4 + mesh::find_edge(a, b))];
  return {4 * xm[0] - 3 * xa[0] - xb[0], 4 * xm[1] - 3 * xa[1] - xb[1], 4 * xm[2] - 3 * xa[2] - xb[2]};
}

/// Corners of the faces, (faces, 3).
std::vector<Corner> list_corners(const mesh::LocalMesh& local, const std::vector<Face>& faces) {
  std::vector<Corner> corners;
  for (const Face& face : faces)
    for (int i = 0; i < 3; ++i) {
      const auto& loop = mesh::kFaces[face.face];
      const int a = loop[i], b = loop[(i + 1) % 3], c = loop[(i + 2) % 3];
      const std::int32_t node = get_node(local, face.tet, a);
      const Vec3 to_b = local.nodes_m[get_node(local, face.tet, b)] - local.nodes_m[node];
      const Vec3 to_c = local.nodes_m[get_node(local, face.tet, c)] - local.nodes_m[node];
      const Vec3 chord = cross(to_b, to_c);
      const Vec3 normal = normalise(cross(find_tangent(local, face, a, b), find_tangent(local, face, a, c)));
      corners.push_back({local.node_in_mesh[node], normal, std::sqrt(dot(chord, chord)) / (dot(to_b, to_b) * dot(to_c, to_c))});
    }
  return corners;
}

/// Normals at a corner of a face.
struct Normals {
  Vec3 smooth{};  // unit: mean of the corners at its vertex within the smoothing angle
  Vec3 round{};   // unit: the same for the alternative surface
};

std::vector<Normals> smooth_normals(const std::vector<Corner>& corners) {
  std::unordered_map<std::int32_t, std::vector<const Corner*>> around;
  for (const Corner& corner : corners) around[corner.vertex].push_back(&corner);
  std::vector<Normals> normals;
  for (const Corner& corner : corners) {
    Vec3 smooth{}, round{};
    for (const Corner* other : around[corner.vertex]) {
      const double cosine = dot(other->normal, corner.normal);
      if (cosine < kRoundCosine) continue;
      for (int k = 0; k < 3; ++k) {
        round[k] += other->weight * other->normal[k];
        if (cosine >= kSmoothCosine) smooth[k] += other->weight * other->normal[k];
      }
    }
    normals.push_back({normalise(smooth), normalise(round)});
  }
  return normals;
}

/// Normals at the corners of the faces, (faces, 3). Collective.
std::vector<Normals> find_normals(const comm::Communicator& comm, const mesh::LocalMesh& local, const std::vector<Face>& faces) {
  const auto corners = comm.agree([&] { return list_corners(local, faces); });
  return comm::query_owners<Normals>(
      comm, corners, [&](const Corner& corner) { return corner.vertex % comm.size(); },
      [](const comm::ByRank<Corner>& met) { return smooth_normals(met.items); });
}

/// Gap between the mesh and a smooth surface with normals na, nb at the corners a, b of an element, in the middle of their edge.
double calc_gap(const mesh::LocalMesh& local, std::int32_t tet, int a, int b, const Vec3& na, const Vec3& nb) {
  const Vec3 &xa = local.nodes_m[get_node(local, tet, a)], &xb = local.nodes_m[get_node(local, tet, b)];
  double gap = dot(nb - na, xb - xa) / 8;
  if (local.order == 1) return gap;
  const Vec3 mean = normalise(na + nb);
  const double across = dot(na, mean);  // same for nb
  if (across > 0.5) gap = (gap + gap / across) / 2 + kParabola * (gap / across - gap);
  const Vec3& xm = local.nodes_m[get_node(local, tet, 4 + mesh::find_edge(a, b))];
  return gap - dot(xm - 0.5 * (xa + xb), mean);
}

/// Surface flags of a node.
struct Mark {
  std::int32_t node = 0;  // in the whole mesh
  float bend = 0.0F;
  char is_outer = 0, singular = 0;

  void join(const Mark& other) {
    bend = std::max(bend, other.bend);
    is_outer |= other.is_outer;
    singular |= other.singular;
  }
};

/// Sets the node flags; bend: (faces) value of each face. Collective.
std::vector<Mark> find_marks(const comm::Communicator& comm, const mesh::LocalMesh& local, const std::vector<Face>& faces,
                             const std::vector<float>& bend) {
  struct Side {
    std::array<std::int32_t, 2> key;  // node numbers in the whole mesh, ascending
    Vec3 normal, across;              // unit, at the middle of the edge: of the face; in the face, from the edge to the opposite corner
    char is_fixed;
  };
  std::vector<std::array<std::int32_t, 2>> ends;  // local nodes of the sides
  const auto sides = comm.agree([&] {
    std::vector<Side> list;
    for (const Face& face : faces) {
      const auto& loop = mesh::kFaces[face.face];
      std::array<std::int32_t, 3> nodes;
      for (int i = 0; i < 3; ++i) nodes[i] = get_node(local, face.tet, loop[i]);
      const std::array<Vec3, 3> x{local.nodes_m[nodes[0]], local.nodes_m[nodes[1]], local.nodes_m[nodes[2]]};
      const bool is_fixed = local.row[nodes[0]] < 0 && local.row[nodes[1]] < 0 && local.row[nodes[2]] < 0;
      for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        const auto [low, high] = std::minmax(local.node_in_mesh[nodes[i]], local.node_in_mesh[nodes[j]]);
        Vec3 across = x[k] - 0.5 * (x[i] + x[j]);
        if (local.order == 2) {  // derivative of the quadratic map
          const auto middle = [&](int a, int b) { return local.nodes_m[get_node(local, face.tet, 4 + mesh::find_edge(loop[a], loop[b]))]; };
          across = 2 * (middle(j, k) + middle(k, i) - middle(i, j)) - 0.5 * (x[i] + x[j]) - x[k];
        }
        list.push_back({{low, high}, normalise(cross(x[j] - x[i], across)), normalise(across), static_cast<char>(is_fixed)});
        ends.push_back({nodes[i], nodes[j]});
      }
    }
    return list;
  });
  const auto singular = comm::query_owners<char>(
      comm, sides, [&](const Side& side) { return side.key[0] % comm.size(); },
      [](const comm::ByRank<Side>& met) {
        std::map<std::array<std::int32_t, 2>, std::vector<std::size_t>> at;
        for (std::size_t i = 0; i < met.items.size(); ++i) at[met.items[i].key].push_back(i);
        std::vector<char> answers(met.items.size(), 0);
        for (const auto& [key, all] : at)
          for (const std::size_t i : all)
            for (const std::size_t j : all) {
              const Side &a = met.items[i], &b = met.items[j];
              const int kind = (a.is_fixed != b.is_fixed ? kRim : 0) | (dot(a.normal, b.across) > kInwardSine ? kInward : 0);
              if (i != j) answers[i] |= static_cast<char>(kind), answers[j] |= static_cast<char>(kind);
            }
        return answers;
      });
  // Ranks with an element but no face at such a node need the flags too.
  const auto marks = comm.agree([&] {
    std::vector<Mark> list(local.nodes_m.size());
    for (std::size_t n = 0; n < list.size(); ++n) list[n].node = local.node_in_mesh[n];
    for (std::size_t s = 0; s < ends.size(); ++s)  // three per face
      for (const std::int32_t node : ends[s]) list[node].join({0, bend[s / 3], 1, singular[s]});
    return list;
  });
  return comm::query_owners<Mark>(
      comm, marks, [&](const Mark& mark) { return mark.node % comm.size(); },
      [](const comm::ByRank<Mark>& met) {
        std::unordered_map<std::int32_t, Mark> all;
        for (const Mark& mark : met.items) all[mark.node].join(mark);
        std::vector<Mark> answers;
        for (const Mark& mark : met.items) answers.push_back(all[mark.node]);
        return answers;
      });
}

}  // namespace

Surface find_surface(const comm::Communicator& comm, const mesh::LocalMesh& local) {
  const std::vector<Face> faces = find_faces(comm, local);
  const std::vector<Normals> normals = find_normals(comm, local, faces);
  Surface surface;
  std::vector<float> bend(faces.size(), 0.0F);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const auto& loop = mesh::kFaces[faces[f].face];
    std::array<std::int32_t, 3> nodes;
    for (int i = 0; i < 3; ++i) nodes[i] = get_node(local, faces[f].tet, loop[i]);
    const Vec3& origin = local.nodes_m[nodes[0]];
    const Vec3 area = cross(local.nodes_m[nodes[1]] - origin, local.nodes_m[nodes[2]] - origin);
    const double twice = std::sqrt(dot(area, area)), third = twice / 6;
    const bool is_fixed = local.row[nodes[0]] < 0 && local.row[nodes[1]] < 0 && local.row[nodes[2]] < 0;
    FreeFace free{faces[f].tet, static_cast<std::int8_t>(faces[f].face), {}, twice / 2, 0.0};
    const Vec3& apex = local.nodes_m[get_node(local, faces[f].tet, faces[f].face)];  // opposite
    if (twice > 0) free.height_m = std::abs(dot(area, apex - origin)) / twice;
    bool is_doubtful = !local.is_surface_known && local.doubt_m.empty();  // not judged by the mesher
    for (int i = 0; i < 3; ++i) is_doubtful = is_doubtful && dot(normals[3 * f + i].smooth, normals[3 * f + i].round) < kSameCosine;
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, edge = mesh::find_edge(loop[i], loop[j]);
      const Vec3 &xa = local.nodes_m[nodes[i]], &xb = local.nodes_m[nodes[j]], along = xb - xa;
      const Normals &a = normals[3 * f + i], &b = normals[3 * f + j];
      free.normal[i] = normalise(a.smooth + b.smooth);
      if (free.height_m > 0) bend[f] = std::max(bend[f], static_cast<float>(std::abs(dot(b.smooth - a.smooth, along) / 8) / free.height_m));
      const double gap = calc_gap(local, faces[f].tet, loop[i], loop[j], a.smooth, b.smooth);
      const double doubt = is_doubtful ? calc_gap(local, faces[f].tet, loop[i], loop[j], a.round, b.round) - gap : 0.0;
      for (const auto& [to, height] : {std::pair(&surface.edges, gap), std::pair(&surface.doubts, doubt)})
        if (height * height > 1e-20 * dot(along, along))
          to->push_back({faces[f].tet, static_cast<std::int8_t>(edge), is_fixed, height, third});
    }
    if (!is_fixed) surface.free_faces.push_back(free);
  }
  for (const Mark& mark : find_marks(comm, local, faces, bend)) {
    surface.singular.push_back(mark.singular);
    surface.is_outer.push_back(mark.is_outer);
    surface.bend.push_back(mark.bend);
  }
  return surface;
}

std::vector<SurfaceEdge> find_doubtful_edges(const comm::Communicator& comm, const mesh::LocalMesh& local) {
  std::vector<SurfaceEdge> edges;
  if (comm.all(local.doubt_m.empty())) return edges;
  const std::vector<Face> faces = find_faces(comm, local);
  if (local.doubt_m.empty()) return edges;
  for (const Face& face : faces) {
    const auto& loop = mesh::kFaces[face.face];
    std::array<std::int32_t, 3> nodes;
    for (int i = 0; i < 3; ++i) nodes[i] = get_node(local, face.tet, loop[i]);
    const Vec3 area = cross(local.nodes_m[nodes[1]] - local.nodes_m[nodes[0]], local.nodes_m[nodes[2]] - local.nodes_m[nodes[0]]);
    const Vec3 normal = normalise(area);
    const bool is_fixed = local.row[nodes[0]] < 0 && local.row[nodes[1]] < 0 && local.row[nodes[2]] < 0;
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, edge = mesh::find_edge(loop[i], loop[j]);
      const double gap = local.order == 2 ? dot(local.doubt_m[get_node(local, face.tet, 4 + edge)], normal)
                                          : 0.5 * (dot(local.doubt_m[nodes[i]], normal) + dot(local.doubt_m[nodes[j]], normal));
      if (gap != 0.0) edges.push_back({face.tet, static_cast<std::int8_t>(edge), is_fixed, gap, std::sqrt(dot(area, area)) / 6});
    }
  }
  return edges;
}

}  // namespace carillon::error_bars
