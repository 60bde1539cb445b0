// A PLC on j2mod: claims the right to write, triggers, and reads back. usage: Client HOST PORT
import com.ghgande.j2mod.modbus.ModbusSlaveException;
import com.ghgande.j2mod.modbus.facade.ModbusTCPMaster;
import com.ghgande.j2mod.modbus.procimg.InputRegister;
import com.ghgande.j2mod.modbus.procimg.Register;
import com.ghgande.j2mod.modbus.procimg.SimpleRegister;
import com.ghgande.j2mod.modbus.util.BitVector;

class Client {
    private interface Question {
        void ask() throws Exception;
    }

    private static void expect(boolean holds, String what) {
        if (!holds) {
            throw new AssertionError(what);
        }
    }

    private static void refused(int exception, Question question) throws Exception {
        try {
            question.ask();
        } catch (ModbusSlaveException error) {
            expect(error.getType() == exception, "exception " + exception + ", not " + error.getType());
            return;
        }
        throw new AssertionError("exception " + exception + " did not come");
    }

    public static void main(String[] arguments) throws Exception {
        ModbusTCPMaster plc = new ModbusTCPMaster(arguments[0], Integer.parseInt(arguments[1]), 20_000, false);
        plc.connect();
        Register[] reference = plc.readMultipleRegisters(1, 244, 2);
        expect(reference[0].getValue() == 0x1234 && reference[1].getValue() == 0x5678, "the long reference");
        InputRegister[] same = plc.readInputRegisters(1, 244, 2);
        expect(same[0].getValue() == 0x1234 && same[1].getValue() == 0x5678, "the same by function 4");
        plc.writeSingleRegister(1, 26, new SimpleRegister(0x5AFE));
        plc.writeMultipleRegisters(1, 0, new Register[] {new SimpleRegister(1), new SimpleRegister(81)});
        plc.writeCoil(1, 3, true);
        BitVector coils = plc.readCoils(1, 0, 9);
        expect(coils.getBit(0) && coils.getBit(3) && !coils.getBit(1), "the flags");
        refused(2, () -> plc.readMultipleRegisters(1, 60, 1));
        refused(3, () -> plc.writeSingleRegister(1, 2, new SimpleRegister(1)));
        plc.disconnect();
    }
}
