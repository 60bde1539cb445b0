// A client on modbus-serial that asks many things at once on one connection: faults in pipelining show as answers to
// another question. usage: node parallel.js HOST PORT
const assert = require("node:assert");
const ModbusRTU = require("modbus-serial");

async function main(host, port) {
  const plc = new ModbusRTU();
  await plc.connectTCP(host, { port: Number(port) });
  plc.setID(1);
  plc.setTimeout(20000);
  const expected = new Map([[241, [0x1234]], [244, [0x1234, 0x5678]], [250, [0x4142, 0x4344]], [248, [0xfffe]]]);
  for (let round = 0; round < 50; round++) {
    await Promise.all([...expected].map(async ([address, words]) => {
      const read = round % 2 ? plc.readInputRegisters.bind(plc) : plc.readHoldingRegisters.bind(plc);
      assert.deepStrictEqual((await read(address, words.length)).data, words);
    }));
    await assert.rejects(plc.readHoldingRegisters(60, 1), (error) => error.modbusCode === 2);
  }
  await plc.writeRegister(26, 0x5afe);
  await Promise.all([plc.writeRegisters(0, [1, 79]), plc.readCoils(0, 9), plc.readDiscreteInputs(1600, 16)]);
  assert.deepStrictEqual((await plc.readHoldingRegisters(0, 2)).data, [1, 79]);
  const identity = await plc.readDeviceIdentification(1, 0);
  assert.strictEqual(identity.data[0], "fruit-station");
  plc.close(() => {});
}

main(process.argv[2], process.argv[3]).catch((error) => {
  console.error(error);
  process.exit(1);
});
