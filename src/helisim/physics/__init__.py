"""The force laws, compiled, and the callbacks that lend them to MuJoCo.

layout, kernel, memory  a vehicle's numbers, how functions are compiled, how they read mjModel
motion, air             axes and motion of a body; wind, gust, turbulence, the ground's nearness
inflow, rotor           momentum balance and dynamic inflow; main and tail rotor in it
flow, flapping          wake and loads of rotors and airframe; the tip-path plane
drive, servo            what turns the rotor: motor, freewheel, governor; servos and their mixing
gyro, pilot             the shipped control laws; the sticks of hover, sweep and doublet
laws, controller        laws of users and helisim's own; which law acts at a tick, what it sees
examination, native     what a model lacks; the callbacks, compiled and installed
"""
