// Transforms of glTF nodes with Eigen. Internal header.
#pragma once

#include <Eigen/Dense>
#include <array>

#include "runtime/base/json.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/exchange/gltf/nodes.hpp"

namespace carillon::exchange {

inline Eigen::Matrix3d get_linear(const gltf::Matrix& m) {
  Eigen::Matrix3d linear;
  linear << m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10];
  return linear;
}

inline Eigen::Vector3d get_place(const gltf::Matrix& m) { return {m[12], m[13], m[14]}; }
inline Eigen::Vector3d to_eigen(const Vec3& v) { return {v[0], v[1], v[2]}; }
inline Vec3 to_vec3(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

/// y up to z up.
inline Eigen::Vector3d raise(const Eigen::Vector3d& v) { return {v[0], -v[2], v[1]}; }

/// The nearest rotation; that of a reflection is of its negative.
inline Eigen::Matrix3d find_rotation(const Eigen::Matrix3d& linear) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(linear, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d turn = svd.matrixU() * svd.matrixV().transpose();
  return turn.determinant() < 0.0 ? Eigen::Matrix3d(-turn) : turn;
}

inline base::Json make_list(const Eigen::Vector3d& v) {
  return base::Json::array(std::array<double, 3>{v[0] + 0.0, v[1] + 0.0, v[2] + 0.0});
}

}  // namespace carillon::exchange
