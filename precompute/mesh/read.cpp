#include "precompute/mesh/read.hpp"

#include <algorithm>
#include <cctype>
#include <new>

#include "precompute/mesh/build_mesh.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/foreign.hpp"
#include "runtime/base/includes.hpp"

namespace carillon::mesh {

namespace {

/// Upper limit of the file size; larger files are refused.
constexpr std::uint64_t kMaxBytes = 32ULL << 30;

std::string read_bytes(const std::filesystem::path& file) {
  std::string bytes = base::read_file(file, "mesh file", kMaxBytes);
  if (bytes.empty()) throw InputError(fmt::format("{}: the file is empty; write the mesh again", file.string()));
  return bytes;
}

/// Format by the first word of the file.
MeshFormat find_format(std::string_view bytes, const std::string& name, const std::string& extension) {
  constexpr const char* kReadable =
      "carillon reads Gmsh .msh (2.2, 4.1), VTU, Medit .mesh, TetGen .node/.ele, CalculiX and Abaqus .inp, Nastran .bdf and UNV";
  base::refuse_utf16(bytes, name);
  std::string_view head = bytes.substr(0, 4096);
  if (head.starts_with("\xEF\xBB\xBF")) head.remove_prefix(3);
  const auto begin = head.find_first_not_of(" \t\r\n");
  if (begin == std::string_view::npos) throw InputError(fmt::format("{}:1: the file holds only blanks; write the mesh again", name));
  head.remove_prefix(begin);
  if (extension == ".inp") return MeshFormat::kInp;
  if (extension == ".bdf" || extension == ".nas") return MeshFormat::kBdf;
  if (extension == ".unv" || extension == ".uff") return MeshFormat::kUnv;
  if (head.front() == '$' && head.size() > 1 && std::isalpha(static_cast<unsigned char>(head[1])) != 0) return MeshFormat::kGmsh;
  if (head.front() == '<') return MeshFormat::kVtu;
  if (head.starts_with("MeshVersionFormatted") || (head.front() == '#' && extension == ".mesh")) return MeshFormat::kMedit;
  if (head.starts_with("MFEM mesh")) throw InputError(fmt::format("{}:1: an MFEM mesh; {}: convert it", name, kReadable));
  if (extension == ".meshb") throw InputError(fmt::format("{}: binary Medit is not read; save as ASCII .mesh", name));
  if (head.starts_with("# vtk DataFile")) throw InputError(fmt::format("{}:1: a legacy VTK file; {}: save as .vtu", name, kReadable));
  if (extension == ".mesh") return MeshFormat::kMedit;
  if (extension == ".msh") return MeshFormat::kGmsh;
  if (extension == ".stl" || extension == ".obj" || extension == ".ply" || extension == ".off" || extension == ".glb" ||
      extension == ".gltf")
    throw InputError(
        fmt::format("{}: a surface ({}), not a volume mesh; make one with carillon-mesh {} -o OUT.msh", name, extension, name));
  throw InputError(fmt::format("{}:1: not a mesh file that is known (it begins with {}); {}: convert it", name,
                               quote_excerpt(head.substr(0, head.find('\n'))), kReadable));
}

std::string_view view_of(std::span<const std::byte> bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }

}  // namespace

TetMesh parse_mesh(std::span<const std::byte> bytes, const std::string& name, MeshFormat format) {
  std::string_view text = view_of(bytes);
  if (format == MeshFormat::kTetgen) {
    const auto split = text.find('\0');
    return parse_tetgen(text.substr(0, split), name + ".node",
                        split == std::string_view::npos ? std::string_view{} : text.substr(split + 1), name + ".ele");
  }
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);  // UTF-8 byte-order mark
  if (format == MeshFormat::kGmsh) return parse_gmsh(text, name);
  if (format == MeshFormat::kVtu) return parse_vtu(text, name);
  if (format == MeshFormat::kInp) return parse_inp(text, name);
  if (format == MeshFormat::kBdf) return parse_bdf(text, name);
  if (format == MeshFormat::kUnv) return parse_unv(text, name);
  return parse_medit(text, name);
}

TetMesh read_mesh(const std::filesystem::path& file) {
  try {
    const std::string extension = base::find_extension(file);
    if (extension == ".node" || extension == ".ele") {
      const auto partner = [&](const char* wanted) {
        return extension == wanted ? file : std::filesystem::path(file).replace_extension(wanted);
      };
      const std::string node = read_bytes(partner(".node"));
      const std::string ele = read_bytes(partner(".ele"));
      return parse_tetgen(node, partner(".node").string(), ele, partner(".ele").string());
    }
    std::string bytes = read_bytes(file);
    if (base::may_include(file)) {
      if (bytes.starts_with("\xEF\xBB\xBF")) bytes.erase(0, 3);
      const MeshFormat format = find_format(bytes, file.string(), extension);
      const base::JoinedText joined = base::join_includes(file, std::move(bytes), kMaxBytes);
      return format == MeshFormat::kInp ? parse_inp(joined.text, file.string(), joined.origins)
                                        : parse_bdf(joined.text, file.string(), joined.origins);
    }
    return parse_mesh(std::as_bytes(std::span(bytes)), file.string(), find_format(bytes, file.string(), extension));
  } catch (const std::bad_alloc&) {
    throw MemoryError(fmt::format("{}: not enough memory to read the mesh; use a machine with more, or a coarser mesh", file.string()));
  }
}

double scale_lengths(TetMesh& mesh, double metres_per_unit) {
  const double scale = metres_per_unit != 1.0 ? metres_per_unit : mesh.unit_m;
  mesh.unit_m = 1.0;
  if (scale != 1.0)
    for (std::vector<Vec3>* lengths : {&mesh.nodes_m, &mesh.doubt_m})
      for (Vec3& length : *lengths)
        for (double& x : length) x *= scale;
  return scale;
}

}  // namespace carillon::mesh
