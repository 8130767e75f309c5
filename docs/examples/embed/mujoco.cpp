// Any MuJoCo model, whose bodies sound: carillon/mujoco.h reads its contacts.
//
//   mujoco_play MODEL.xml OUT.f32 BODY=BANK...    bodies of these names sound as their banks, and get their mass and inertia; OUT: pressure
//   at two ears [Pa], pairs of floats at 48 kHz
#include <carillon/mujoco.h>

#include <algorithm>
#include <string>

#include "sound.hpp"

namespace {

constexpr double kSeconds = 2.0;
constexpr double kRestitution = 0.5, kFriction = 0.4;

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) return std::fputs("usage: mujoco_play MODEL.xml OUT.f32 BODY=BANK...\n", stderr), 2;
  char fault[1000] = "";
  mjModel* model = mj_loadXML(argv[1], nullptr, fault, sizeof fault);
  if (model == nullptr) return std::fprintf(stderr, "%s: %s\n", argv[1], fault), 1;
  mjData* data = mj_makeData(model);

  carillon_touches_options options;
  carillon_touches_options_init(&options);
  options.compliant = 1;
  std::copy_n(model->opt.gravity, 3, options.gravity_m_s2);
  Sound sound(options);
  carillon::MujocoTouches mujoco(model, data, sound.get_touches());
  for (int i = 3; i < argc; ++i) {
    const std::string word = argv[i], name = word.substr(0, word.find('=')), bank = word.substr(word.find('=') + 1);
    const int body = mj_name2id(model, mjOBJ_BODY, name.c_str());
    if (body < 0) return std::fprintf(stderr, "%s: has no body %s\n", argv[1], name.c_str()), 1;
    const std::int32_t index = sound.add(bank.c_str(), name.c_str(), kRestitution, kFriction);
    carillon::set_mass(model, body, sound.get_bank(index));
    mujoco.add(body, index);
  }
  mj_setConst(model, data);  // quantities derived from the masses

  Message message;
  message.check(mujoco.start(message.text(), message.size()));
  while (data->time < kSeconds) {
    mj_step(model, data);
    message.check(mujoco.step(message.text(), message.size()));  // after every step: springs have many in a contact
    sound.play();
  }
  sound.finish(argv[2]);
  mj_deleteData(data);
  mj_deleteModel(model);
  return 0;
}
