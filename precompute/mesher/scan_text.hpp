// A first look at the text formats of surfaces, for what CGAL's readers skip over or do not place.
#pragma once

#include <filesystem>
#include <string>

namespace carillon::mesher {

/// Throws InputError, naming the line, if a coordinate is no finite number or a face names a vertex that is not there.
/// `format` is obj, off, ply or stl; binary files are not looked at.
void scan_text(const std::filesystem::path& path, const std::string& format);

}  // namespace carillon::mesher
