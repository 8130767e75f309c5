#include <carillon/mujoco.h>

#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "tests/system/engines/engine.hpp"

namespace carillon::testing {
namespace {

constexpr double kSpring = 0.008;  // s; first number of solref
// s; in a step friction parts surfaces at 2 mu v step / kSpring, and beyond half of kSpring bodies gain energy.
constexpr double kLongestStep = 2.5e-4;

template <class... Numbers>
std::string format(const char* text, Numbers... numbers) {
  char line[1000];
  std::snprintf(line, sizeof line, text, numbers...);
  return line;
}

/// Damping ratio of a contact, the second number of solref.
double calc_damping(double restitution) {
  const double decrement = -std::log(restitution);
  return decrement / std::hypot(M_PI, decrement);
}

std::string describe(const Solid& s) {
  const double *p = s.position_m, *q = s.rotation, *i = s.inertia_kg_m2, *h = s.half_m;
  std::string text = format("<body name='%s' pos='%.9g %.9g %.9g' quat='%.9g %.9g %.9g %.9g'><freejoint/>", s.name.c_str(), p[0], p[1],
                            p[2], q[0], q[1], q[2], q[3]);
  text += format("<inertial pos='0 0 0' mass='%.9g' diaginertia='%.9g %.9g %.9g'/>", s.mass_kg, i[0], i[1], i[2]);
  if (s.kind == "box")
    text += format("<geom type='box' size='%.9g %.9g %.9g'", h[0], h[1], h[2]);
  else if (s.kind == "ball")
    text += format("<geom type='sphere' size='%.9g'", h[0]);
  else
    text += format("<geom type='cylinder' size='%.9g %.9g' euler='0 90 0'", h[1], h[0]);
  return text + format(" priority='1' solref='%.9g %.3f'/></body>", kSpring, calc_damping(s.restitution));  // not mixed with the ground's
}

class Mujoco : public Engine {
 public:
  Mujoco(const std::vector<Solid>& solids, double step_s, carillon_touches* touches)
      : substeps_(static_cast<int>(std::ceil(step_s / kLongestStep - 1e-9))) {
    std::string text = format(
        "<mujoco><compiler angle='degree'/><option timestep='%.9g' cone='elliptic' impratio='10'/><default><geom "
        "friction='%.3f 0.0001 0.00001' solref='%.9g %.3f' solimp='0.95 0.99 0.0005' condim='4'/></default>"
        "<worldbody><geom type='plane' size='5 5 0.1'/>",
        step_s / substeps_, kFriction, kSpring, calc_damping(kRestitution));
    for (const Solid& solid : solids) text += describe(solid);
    text += "</worldbody></mujoco>";
    std::FILE* file = std::fopen("mujoco.xml", "w");
    if (file == nullptr) throw std::runtime_error("mujoco.xml: cannot be written");
    std::fputs(text.c_str(), file);
    std::fclose(file);
    char message[1000] = "";
    model_ = mj_loadXML("mujoco.xml", nullptr, message, sizeof message);
    if (model_ == nullptr) throw std::runtime_error(message);
    data_ = mj_makeData(model_);
    reader_ = std::make_unique<MujocoTouches>(model_, data_, touches);
    for (std::size_t i = 0; i < solids.size(); ++i) {
      const int body = mj_name2id(model_, mjOBJ_BODY, solids[i].name.c_str());
      mjtNum* speed = data_->qvel + model_->body_dofadr[body];
      const auto& q = solids[i].rotation;
      const mjtNum back[4] = {q[0], -q[1], -q[2], -q[3]};
      for (int k = 0; k < 3; ++k) speed[k] = solids[i].velocity_m_s[k];
      mju_rotVecQuat(speed + 3, solids[i].spin_rad_s, back);  // of free joints it is in the axes of the body
      reader_->add(body, static_cast<std::int32_t>(i));
    }
  }
  ~Mujoco() override {
    mj_deleteData(data_);
    mj_deleteModel(model_);
  }

  carillon_status start(char* message, std::size_t size) override { return reader_->start(message, size); }
  carillon_status step(double, char* message, std::size_t size) override {
    for (int n = 1; n < substeps_; ++n) {
      mj_step(model_, data_);
      if (const carillon_status status = reader_->step(message, size); status != CARILLON_OK) return status;
    }
    mj_step(model_, data_);
    return reader_->step(message, size);
  }

 private:
  int substeps_;
  mjModel* model_ = nullptr;
  mjData* data_ = nullptr;
  std::unique_ptr<MujocoTouches> reader_;
};

}  // namespace

void set_options(carillon_touches_options& options) { options.compliant = 1; }
std::unique_ptr<Engine> make_engine(const std::vector<Solid>& solids, double step_s, carillon_touches* touches) {
  return std::make_unique<Mujoco>(solids, step_s, touches);
}

}  // namespace carillon::testing
