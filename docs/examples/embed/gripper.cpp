// A gripper simulated by MuJoCo moves twenty objects one by one to the other half of a table, and pushes the bars. Writes the contacts to a
// file for carillon-render (--contacts, --labels).
//
//   mujoco_gripper FOLDER OUT.jsonl    FOLDER: banks table, finger, box, can, ball and bar (.hdf). Prints actions with
//   their times, and the CPU time, as lines of JSON.
#include <carillon/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <string>
#include <vector>

#include "contacts_file.hpp"

namespace {

constexpr double kRestitution = 0.46, kFriction = 0.45;
constexpr mjtNum kRollDamping = 1e-4;           // N m s/rad; stops rolling cans and balls
constexpr double kOpen = 0.0, kClosed = 0.045;  // m; travel of each finger
constexpr int kObjects = 20, kColumns = 5;
const char* const kKinds[] = {"bar", "box", "can", "ball"};
const char* const kGeoms[] = {"type='box' size='0.06 0.006 0.0125'", "type='box' size='0.03 0.025 0.025'",
                              "type='cylinder' size='0.02 0.05' zaxis='1 0 0'", "type='sphere' size='0.025'"};
const double kHeights[] = {0.0125, 0.025, 0.02, 0.025};  // m; centres above the table

std::string make_name(int object) { return kKinds[object % 4] + std::to_string(object / 4 + 1); }

/// The hand has three position actuators; in its lowest position the ends of its fingers are 7 mm above the table.
std::string make_model() {
  std::string text =
      R"(<mujoco><size nconmax="500" njmax="2000"/><option timestep="0.001" cone="elliptic" impratio="10" jacobian="sparse"/><default>
    <geom friction="0.45 0.0001 0.00001" solref="0.008 0.3" solimp="0.5 0.95 0.001" condim="4"/>
    <position kp="5000" forcelimited="true" forcerange="-400 400"/></default>
    <worldbody><body name="table" pos="0.05 0 -0.01"><geom type="plane" size="0.6 0.35 1" pos="0 0 0.01"/>
    <geom type="box" size="0.6 0.01 0.02" pos="0 0.36 0.02"/><geom type="box" size="0.6 0.01 0.02" pos="0 -0.36 0.02"/>
    <geom type="box" size="0.01 0.35 0.02" pos="0.61 0 0.02"/><geom type="box" size="0.01 0.35 0.02" pos="-0.61 0 0.02"/></body>
    <body name="hand" pos="0 0 0.047"><inertial pos="0 0 0.06" mass="1" diaginertia="2e-3 2e-3 2e-3"/>
    <joint name="x" type="slide" axis="1 0 0" damping="120"/><joint name="y" type="slide" axis="0 1 0" damping="120"/>
    <joint name="z" type="slide" axis="0 0 1" damping="120"/>)";
  for (const int side : {1, -1})
    text += "<body name='finger" + std::to_string(side > 0 ? 1 : 2) + "' pos='0 " + std::to_string(0.051 * side) +
            " 0' euler='0 90 0'><joint name='f" + std::to_string(side) + "' type='slide' axis='0 " + std::to_string(-side) +
            " 0' damping='15'/><geom type='box' size='0.04 0.006 0.01' friction='1 0.01 0.0001' solref='0.02 1' priority='1'/></body>";
  text += "</body>";
  for (int i = 0; i < kObjects; ++i)
    text += "<body name='" + make_name(i) + "' pos='" + std::to_string(-0.48 + 0.13 * (i % kColumns)) + " " +
            std::to_string(-0.24 + 0.16 * (i / kColumns)) + " " + std::to_string(kHeights[i % 4]) + "'><freejoint/><geom " + kGeoms[i % 4] +
            "/></body>";
  return text + R"(</worldbody><actuator><position joint="x"/><position joint="y"/><position joint="z" forcerange="-120 120"/>
    <position joint="f-1" kp="1000" forcerange="-8 8"/><position joint="f1" kp="1000" forcerange="-8 8"/></actuator></mujoco>)";
}

mjModel* load_model() {
  mjVFS files;
  mj_defaultVFS(&files);
  const std::string text = make_model();
  mj_makeEmptyFileVFS(&files, "gripper.xml", static_cast<int>(text.size()) + 1);
  std::copy_n(text.c_str(), text.size() + 1, static_cast<char*>(files.filedata[0]));
  char fault[1000] = "";
  mjModel* model = mj_loadXML("gripper.xml", &files, fault, sizeof fault);
  mj_deleteVFS(&files);
  if (model == nullptr) std::fprintf(stderr, "%s\n", fault), std::exit(1);
  return model;
}

double get_cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// The model and its contacts, step by step.
class Robot {
 public:
  Robot(mjModel* model, const std::string& folder, ContactsFile& file)
      : model_(model), data_(mj_makeData(model)), mujoco_(model, data_, file.get_touches()) {
    for (int body = 1; body < model->nbody; ++body) {
      const std::string name = mj_id2name(model, mjOBJ_BODY, body), kind = name.substr(0, name.find_first_of("12345"));
      if (name == "hand") continue;  // has no bank: makes no sound
      const std::string bank = folder + "/" + kind + ".hdf";
      mujoco_.add(body, file.add(bank, name, kRestitution, kFriction, kind == "table"));
      carillon::set_mass(model, body, file.get_bank(bank));
      if (model->body_dofnum[body] == 6) std::fill_n(model->dof_damping + model->body_dofadr[body] + 3, 3, kRollDamping);
    }
    mj_setConst(model, data_);
    data_->qpos[2] = data_->ctrl[2] = 0.16;  // the hand begins above the objects
    message_.check(mujoco_.start(message_.text(), message_.size()));
  }
  ~Robot() { mj_deleteData(data_); }

  double time_s() const { return data_->time; }
  const mjtNum* find(const std::string& name) const { return data_->xpos + 3 * mj_name2id(model_, mjOBJ_BODY, name.c_str()); }
  /// Moves hand and fingers smoothly to a position. z: height above the lowest position of the hand [m].
  void move(double x, double y, double z, double grip, double over_s) {
    const std::array<mjtNum, 5> to{x, y, z, grip, grip};
    std::array<mjtNum, 5> from;
    std::copy_n(data_->ctrl, 5, from.begin());
    for (const double begin_s = data_->time; data_->time < begin_s + over_s;) {
      const double part = std::min(1.0, (data_->time + model_->opt.timestep - begin_s) / over_s), smooth = part * part * (3 - 2 * part);
      for (int k = 0; k < 5; ++k) data_->ctrl[k] = from[k] + smooth * (to[k] - from[k]);
      const double begun_s = get_cpu_s();
      mj_step(model_, data_);
      const double stepped_s = get_cpu_s();
      message_.check(mujoco_.step(message_.text(), message_.size()));
      physics_cpu_s += stepped_s - begun_s;
      tracker_cpu_s += get_cpu_s() - stepped_s;
    }
  }
  double physics_cpu_s = 0.0, tracker_cpu_s = 0.0;

 private:
  mjModel* model_;
  mjData* data_;
  carillon::MujocoTouches mujoco_;
  Message message_;
};

void tell(const char* what, const std::string& object, const Robot& robot) {
  std::printf("{\"%s\": \"%s\", \"time_s\": %.3f}\n", what, object.c_str(), robot.time_s());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return std::fputs("usage: mujoco_gripper FOLDER OUT.jsonl\n", stderr), 2;
  mjModel* model = load_model();
  carillon_touches_options options;
  carillon_touches_options_init(&options);
  options.compliant = 1;
  ContactsFile file(options);
  {
    Robot robot(model, argv[1], file);
    for (int i = 0; i < kObjects; ++i) {
      const std::string name = make_name(i);
      const mjtNum* at = robot.find(name);
      const double x = at[0], y = at[1], to_x = 0.28 + 0.09 * (i % 4), to_y = -0.24 + 0.12 * (i / 4);
      robot.move(x, y, 0.12, kOpen, 0.3);
      robot.move(x, y, 0.0, kOpen, 0.2);
      robot.move(x, y, 0.0, kClosed, 0.1);
      tell("lift", name, robot);
      robot.move(x, y, 0.16, kClosed, 0.2);
      robot.move(to_x, to_y, 0.16, kClosed, 0.35);
      tell("drop", name, robot);
      robot.move(to_x, to_y, 0.16, kOpen, 0.1);
      if (i % 4 != 0) continue;  // only bars are pushed
      robot.move(to_x, to_y, 0.16, kClosed, 0.4);
      const double from_x = at[0] - 0.09, from_y = at[1];
      robot.move(from_x, from_y, 0.12, kClosed, 0.1);
      robot.move(from_x, from_y, 0.0, kClosed, 0.2);
      tell("push", name, robot);
      robot.move(from_x + 0.12, from_y, 0.0, kClosed, 0.35);
      robot.move(from_x, from_y, 0.16, kOpen, 0.2);
    }
    robot.move(0, 0, 0.16, kOpen, 1.0);
    std::printf("{\"seconds\": %.3f, \"physics_cpu_s\": %.3f, \"tracker_cpu_s\": %.3f}\n", robot.time_s(), robot.physics_cpu_s,
                robot.tracker_cpu_s);
  }
  file.write(argv[2]);
  mj_deleteModel(model);
  return 0;
}
