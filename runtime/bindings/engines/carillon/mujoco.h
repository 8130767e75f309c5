// The steps of a MuJoCo model for carillon_touches: header of the program that uses MuJoCo, C++11. docs/howto/my-engine.md
#ifndef CARILLON_MUJOCO_H
#define CARILLON_MUJOCO_H

#include <carillon.h>
#include <mujoco/mujoco.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace carillon {

/// Sets mass and inertia of a body of the model from a bank, whose mesh frame is the body's. Call mj_setConst afterwards.
inline void set_mass(mjModel* model, int body, const carillon_bank* bank) {
  carillon_body_facts facts;
  carillon_body_facts_init(&facts);
  carillon_bank_get_facts(bank, &facts);
  mjtNum inertia[9], axes[9];  // principal axes, as columns
  double centre_m[3];
  carillon_bank_centre_m(bank, centre_m);
  for (int k = 0; k < 3; ++k) model->body_ipos[3 * body + k] = mjtNum(centre_m[k]);
  for (int k = 0; k < 9; ++k) inertia[k] = mjtNum(facts.inertia_kg_m2[k]);
  model->body_mass[body] = mjtNum(facts.mass_kg);
  mju_eig3(model->body_inertia + 3 * body, axes, model->body_iquat + 4 * body, inertia);
}

/// Poses and contact points of a MuJoCo model after each mj_step, with any integrator but RK4, whose contacts are of a stage inside the
/// step. Options of the carillon_touches: points_after 0, compliant 1. MuJoCo has no sleep: bodies whose points have been slower than
/// 1 mm/s and within 0.1 mm for 0.1 s are reported asleep. One thread: that of the physics.
class MujocoTouches {
 public:
  /// All must outlive this object.
  MujocoTouches(const mjModel* model, mjData* data, carillon_touches* touches)
      : model_(model), data_(data), touches_(touches), indices_(static_cast<std::size_t>(model->nbody), -1) {}

  /// `body`: id in the model; `index` of carillon_touches_add, one after another from 0. Bodies that are not added belong to the body that
  /// they are welded to, or to the ground. `mesh`: rotation w x y z of the frame of the bank's mesh in the body's frame; null: the same.
  void add(int body, std::int32_t index, const mjtNum* mesh = nullptr) {
    if (bodies_.size() <= static_cast<std::size_t>(index)) bodies_.resize(static_cast<std::size_t>(index) + 1);
    Body& added = bodies_[static_cast<std::size_t>(index)];
    added.id = body;
    for (int k = 0; k < 4; ++k) added.mesh[k] = mesh != nullptr ? mesh[k] : k == 0 ? 1 : 0;
    bool is_free = model_->body_parentid[body] == 0 && model_->body_dofnum[body] == 6;
    for (int other = 1; other < model_->nbody; ++other)
      if (model_->body_parentid[other] == body && model_->body_dofnum[other] > 0) is_free = false;
    added.flags = is_free ? 0u : CARILLON_JOINTED;
    for (int n = 0, geom = model_->body_geomadr[body]; n < model_->body_geomnum[body]; ++n, ++geom) {
      const mjtNum* at = model_->geom_pos + 3 * geom;
      mjtNum arm[3];
      mju_sub3(arm, at, model_->body_ipos + 3 * body);
      added.radius_m = std::fmax(added.radius_m, static_cast<double>(mju_norm3(arm) + model_->geom_rbound[geom]));
    }
    indices_[static_cast<std::size_t>(body)] = index;
  }

  /// Before the first step, and after the program has changed qpos or qvel. Status and message as of carillon_touches_start.
  carillon_status start(char* message, std::size_t size) {
    for (Body& body : bodies_) body.rest = carillon_pose();  // none rests yet
    read_poses();
    return carillon_touches_start(touches_, static_cast<double>(data_->time), poses_.data(), static_cast<std::int32_t>(poses_.size()),
                                  message, size);
  }
  /// After each mj_step. Status and message as of carillon_touches_step.
  carillon_status step(char* message, std::size_t size) {
    read_points();
    read_poses();
    return carillon_touches_step(touches_, static_cast<double>(data_->time), poses_.data(), static_cast<std::int32_t>(poses_.size()),
                                 points_.data(), static_cast<std::int32_t>(points_.size()), message, size);
  }

 private:
  struct Body {
    int id = -1;
    mjtNum mesh[4];
    std::uint32_t flags;
    double radius_m = 0.0;  // about the centre of mass
    carillon_pose rest;     // pose it has stayed at since slow_since_s
    double slow_since_s = 0.0;
  };
  std::int32_t find(int geom) const {
    if (geom < 0) return -1;
    const int body = model_->geom_bodyid[geom];
    const std::int32_t own = indices_[static_cast<std::size_t>(body)];
    return own >= 0 ? own : indices_[static_cast<std::size_t>(model_->body_weldid[body])];
  }

  void read_poses() {
    // mj_step leaves positions and velocities of bodies as they were at its begin.
    mj_kinematics(model_, data_);
    mj_comPos(model_, data_);
    mj_comVel(model_, data_);
    poses_.assign(bodies_.size(), carillon_pose());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      carillon_pose& pose = poses_[i];
      pose.rotation[0] = 1.0;
      if (bodies_[i].id < 0) continue;
      mjtNum motion[6], turn[4];
      mj_objectVelocity(model_, data_, mjOBJ_BODY, bodies_[i].id, motion, 0);
      mju_mulQuat(turn, data_->xquat + 4 * bodies_[i].id, bodies_[i].mesh);
      for (int k = 0; k < 4; ++k) pose.rotation[k] = static_cast<double>(turn[k]);
      for (int k = 0; k < 3; ++k) {
        pose.position_m[k] = static_cast<double>(data_->xipos[3 * bodies_[i].id + k]);
        pose.spin_rad_s[k] = static_cast<double>(motion[k]);
        pose.velocity_m_s[k] = static_cast<double>(motion[3 + k]);
      }
      pose.flags = bodies_[i].flags;
      settle(bodies_[i], pose);
    }
  }
  /// Holds a body at its rest pose, asleep, while its points stay slow and near it.
  void settle(Body& body, carillon_pose& pose) const {
    double way2 = 0.0, turn2 = 0.0, speed2 = 0.0, spin2 = 0.0;
    for (int k = 0; k < 4; ++k) turn2 += 4 * std::pow(pose.rotation[k] - body.rest.rotation[k], 2);
    for (int k = 0; k < 3; ++k) {
      way2 += std::pow(pose.position_m[k] - body.rest.position_m[k], 2);
      speed2 += std::pow(pose.velocity_m_s[k], 2);
      spin2 += std::pow(pose.spin_rad_s[k], 2);
    }
    const double time_s = static_cast<double>(data_->time);
    const auto calc_largest = [&](double centre2, double about2) { return std::sqrt(centre2) + body.radius_m * std::sqrt(about2); };
    if (calc_largest(speed2, spin2) > 1e-3 || calc_largest(way2, turn2) > 1e-4) {
      body.rest = pose;
      body.slow_since_s = time_s;
    } else if (time_s - body.slow_since_s > 0.1) {
      pose = body.rest;
      pose.flags |= CARILLON_ASLEEP;
    }
  }
  void read_points() {
    points_.clear();
    for (int c = 0; c < data_->ncon; ++c) {
      const mjContact& from = data_->contact[c];
      const std::int32_t first = find(from.geom1), second = find(from.geom2);
      if (from.efc_address < 0 || first == second) continue;
      mjtNum force[6];
      mj_contactForce(model_, data_, c, force);
      if (!(force[0] > 0)) continue;
      const mjtNum sign = second < 0 ? -1 : 1;  // the frame's first axis points from geom1 to geom2, pos is in the middle
      carillon_point point = carillon_point();
      point.a = second < 0 ? first : second;
      point.b = second < 0 ? -1 : first;
      for (int k = 0; k < 3; ++k) {
        point.normal[k] = static_cast<double>(sign * from.frame[k]);
        point.point_m[k] = static_cast<double>(from.pos[k] - from.dist / 2 * sign * from.frame[k]);
        point.friction_n_s[k] =
            static_cast<double>(sign * model_->opt.timestep * (force[1] * from.frame[3 + k] + force[2] * from.frame[6 + k]));
      }
      point.gap_m = static_cast<double>(from.dist);
      point.impulse_n_s = static_cast<double>(force[0] * model_->opt.timestep);
      point.curvature_per_m = NAN;  // of the surfaces of the banks
      points_.push_back(point);
    }
  }

  const mjModel* model_;
  mjData* data_;
  carillon_touches* touches_;
  std::vector<std::int32_t> indices_;  // per body of the model; -1: none
  std::vector<Body> bodies_;
  std::vector<carillon_pose> poses_;
  std::vector<carillon_point> points_;
};

}  // namespace carillon

#endif  // CARILLON_MUJOCO_H
