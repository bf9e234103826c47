"""The force laws, compiled, and the callbacks that lend them to MuJoCo.

layout, fields          where a vehicle's numbers and MuJoCo's fields are
kernel, memory          how functions are compiled; how they read mjModel and mjData
callbacks, native       what MuJoCo calls, and how it is lent to it
examination, notes      what a model lacks, and how a callback says so
commands                whether somebody else sets the servos that the gyro flies
frames, body, timing    axes, motion and wrenches; the gyro's ticks and the integrators' steps
rotor                   blade elements in the air that they move
main_rotor, tail_rotor  what each of them does; flow: in the air that passes a vehicle
loads, flapping         forces and moments, the tip-path plane
pitt_peters             how the air follows the blades' loads; dynamic_inflow: the disc in it
drive                   what turns the rotor: motor, freewheel, governor
air                     wind, gust, turbulence and the ground's nearness
pilot, gyro, servo      from what is seen to sticks, from sticks to commands, to positions
controller              which law commands which servos at a tick, and what it sees
laws, own_laws          a user's laws: their table, and Python in it; compiled_laws: numba's
injection               what a manoeuvre adds on the way
faults                  what a fault leaves of servos and gyro
"""
